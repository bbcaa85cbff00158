"""A wheel that carries the program: python3 wheel.py UNPACKED_RELEASE VERSION OUT. Prints the file's name.

The layout is that of maturin's `bindings = "bin"`, with the manual pages and completions beside the program.
"""

import base64
import hashlib
import pathlib
import platform
import re
import sys
import zipfile

release, version, out = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
program = (release / "host-fit").read_bytes()

if sys.platform != "linux":
    sys.exit("wheels are made on Linux so far; elsewhere take the archive")
# The oldest C library that has what the program asks for (PEP 600).
needed = [int(minor) for minor in re.findall(rb"\0GLIBC_2\.(\d+)(?=[\0.])", program)]
if not needed:
    sys.exit("the program is not linked to the GNU C library, which the wheel's name has to state")
tag = f"py3-none-manylinux_2_{max(needed)}_{platform.machine()}"

name = f"host_fit-{version}"
info, data = f"{name}.dist-info", f"{name}.data"
metadata = f"""Metadata-Version: 2.1
Name: host-fit
Version: {version}
Summary: From recordings of an on/off actuator and a sensor to a model with delays, a control law and code
License: MIT OR Apache-2.0
License-File: LICENSE-MIT
License-File: LICENSE-APACHE
License-File: THIRD-PARTY.txt
Requires-Python: >=3.8
Description-Content-Type: text/markdown

"""
files = {
    f"{data}/scripts/host-fit": program,
    f"{data}/data/share/bash-completion/completions/host-fit": (release / "completions/host-fit.bash").read_bytes(),
    f"{data}/data/share/zsh/site-functions/_host-fit": (release / "completions/_host-fit").read_bytes(),
    f"{data}/data/share/fish/vendor_completions.d/host-fit.fish": (release / "completions/host-fit.fish").read_bytes(),
    f"{info}/METADATA": metadata.encode() + (release / "README.md").read_bytes(),
    f"{info}/WHEEL": f"Wheel-Version: 1.0\nGenerator: host-fit\nRoot-Is-Purelib: false\nTag: {tag}\n".encode(),
    f"{info}/sboms/host-fit.cdx.json": (release / "host-fit.cdx.json").read_bytes(),
}
for page in sorted((release / "man/man1").iterdir()):
    files[f"{data}/data/share/man/man1/{page.name}"] = page.read_bytes()
for licence in ["LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.txt"]:
    files[f"{info}/licenses/{licence}"] = (release / licence).read_bytes()

record = ""
for path, content in files.items():
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    record += f"{path},sha256={digest},{len(content)}\n"
files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()

wheel = out / f"{name}-{tag}.whl"
with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
    for path, content in files.items():
        # Without a time: the same program gives the same bytes.
        entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
        entry.compress_type = zipfile.ZIP_DEFLATED
        entry.external_attr = (0o100755 if "/scripts/" in path else 0o100644) << 16
        archive.writestr(entry, content)
print(wheel.name)
