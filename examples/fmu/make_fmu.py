"""An FMU for co-simulation (FMI 3.0) of an exported model: python3 make_fmu.py flow.c flow.fmu

flow.c is what `host-fit codegen model.toml --lang c --precision double -o flow.c` writes. GCC compiles it for this machine;
the sources are in the archive, too. Inputs are u and the model's measured channels, the output is y.
"""

import ctypes
import hashlib
import pathlib
import platform
import re
import subprocess
import sys
import tempfile
import zipfile
from xml.sax.saxutils import quoteattr

source, target = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
text = source.read_text()
if "typedef double real;" not in text:
    sys.exit(f"{source}: export the model with `--lang c --precision double`")
# Several instances may exist: each thread of the simulator has its own copy.
for single in ["static struct model the_model;", "static int begun;"]:
    if text.count(single) != 1:
        sys.exit(f"{source}: not written by `host-fit codegen --lang c`")
    text = text.replace(single, single.replace("static", "static _Thread_local"))
wrapper = (pathlib.Path(__file__).parent / "fmu.c").read_text()
token = hashlib.sha256((text + wrapper).encode()).hexdigest()
# The command of no jet, the initial value of a run.
stated = re.search(r"from now to the next one: (\S+) for no jet", text)
off = float(stated[1]) if stated else 0.0
wrapper = f'#define TOKEN "{token}"\n#define OFF {off!r}\n' + wrapper

system, suffix = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib"), "Windows": ("windows", ".dll")}[platform.system()]
machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine())
with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    (folder / "flow.c").write_text(text)
    (folder / "fmu.c").write_text(wrapper)
    library = folder / f"flow{suffix}"
    options = ["-std=c11", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared"]
    subprocess.run(["gcc", *options, "-o", library, folder / "fmu.c", "-lm"], check=True)
    binary = library.read_bytes()
    model = ctypes.CDLL(str(library))
    model.describe_period.restype = ctypes.c_double
    period = model.describe_period()
    channels = []
    for n in range(model.describe_channels()):
        model.describe_channel.restype, model.describe_usual.restype = ctypes.c_char_p, ctypes.c_double
        channels.append((model.describe_channel(n).decode(), model.describe_usual(n)))

# Records have the columns t, u and y, so no channel has these names.
names = ["t", "u", *(name for name, _ in channels), "y"]
starts = [("u", off), *channels]
inputs = "".join(
    f'    <Float64 name={quoteattr(name)} valueReference="{n}" causality="input" variability="discrete" start="{start!r}"/>\n'
    for n, (name, start) in enumerate(starts, 1)
)
y = len(names) - 1
description = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="flow" instantiationToken="{token}" generationTool="host-fit">
  <CoSimulation modelIdentifier="flow" fixedInternalStepSize="{period!r}"
    canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <DefaultExperiment startTime="0" stepSize="{period!r}"/>
  <ModelVariables>
    <Float64 name="t" valueReference="0" causality="independent" variability="continuous"/>
{inputs}    <Float64 name="y" valueReference="{y}" causality="output" variability="discrete" initial="calculated"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="{y}"/>
    <InitialUnknown valueReference="{y}"/>
  </ModelStructure>
</fmiModelDescription>
"""
build = """<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="flow">
    <SourceFileSet language="C11" compilerOptions="-ffp-contract=off">
      <SourceFile name="fmu.c"/>
    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""
with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
    archive.writestr("modelDescription.xml", description)
    archive.writestr("sources/buildDescription.xml", build)
    archive.writestr("sources/fmu.c", wrapper)
    archive.writestr("sources/flow.c", text)
    archive.writestr(f"binaries/{machine}-{system}/flow{suffix}", binary)
print(f"{target}: {', '.join(names)}, a sample every {period!r} s")
