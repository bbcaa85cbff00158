"""Runs an FMU over a record and compares it with the host's free run: python3 fmu.py FMU RECORD.csv HOST.csv [--fmpy].

With --fmpy the FMU is validated and simulated by FMPy; otherwise its library is called as the standard says, which needs
nothing but Python and NumPy.
"""

import ctypes
import pathlib
import sys
import tempfile
import xml.etree.ElementTree as xml
import zipfile

import numpy as np

fmu, record, host = sys.argv[1:4]
record = np.genfromtxt(record, delimiter=",", names=True)
expected = np.genfromtxt(host, delimiter=",", names=True)["y"]
inputs = [name for name in record.dtype.names if name not in ("t", "y")]


def by_fmpy():
    import fmpy
    from fmpy.validation import validate_fmu

    problems = validate_fmu(fmu)
    if problems:
        sys.exit("\n".join(problems))
    period = record["t"][1] - record["t"][0]
    signals = np.empty(len(record), [("time", float), *((name, float) for name in inputs)])
    # Half a period early: the simulator adds up its times, and may be a rounding before a sample.
    signals["time"] = np.maximum(record["t"] - 0.5 * period, 0.0)
    for name in inputs:
        signals[name] = record[name]
    end = period * (len(record) - 1)
    return fmpy.simulate_fmu(fmu, stop_time=end, output_interval=period, input=signals, output=["y"])["y"]


def by_its_library():
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        folder = pathlib.Path(folder)
        root = xml.parse(folder / "modelDescription.xml").getroot()
        references = {one.get("name"): int(one.get("valueReference")) for one in root.iter("Float64")}
        period = float(root.find("DefaultExperiment").get("stepSize"))
        library = ctypes.CDLL(str(next((folder / "binaries").glob("*/*"))))
        library.fmi3InstantiateCoSimulation.restype = ctypes.c_void_p

        def create(token):
            begin = [b"it", token.encode(), None, False, False, False, False, None, ctypes.c_size_t(0), None, None, None]
            return library.fmi3InstantiateCoSimulation(*begin)

        if create("another") is not None:
            sys.exit("an instance was made with a wrong token")
        ran = ctypes.c_void_p(create(root.get("instantiationToken")))
        # Beside it in the same process: it must not disturb the first.
        other = ctypes.c_void_p(create(root.get("instantiationToken")))
        one = (ctypes.c_uint32 * 1)
        value, count = (ctypes.c_double * 1)(), ctypes.c_size_t(1)
        flags, last = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()

        def called(name, *arguments):
            if getattr(library, name)(*arguments) != 0:
                sys.exit(f"{name} failed")

        def step(instance, size):
            after = [*map(ctypes.byref, flags), ctypes.byref(last)]
            return library.fmi3DoStep(instance, ctypes.c_double(0.0), ctypes.c_double(size), True, *after)

        zero = ctypes.c_double(0.0)
        for instance in (ran, other):
            called("fmi3EnterInitializationMode", instance, False, zero, zero, False, zero)
            called("fmi3ExitInitializationMode", instance)
        if step(ran, 0.5 * period) == 0:
            sys.exit("half a sample period was taken for a step")
        readings, saved, size, none = [], ctypes.c_void_p(), ctypes.c_size_t(), ctypes.c_void_p()
        for k, row in enumerate(record):
            if k == 1000:
                # There and back by way of bytes; steps between must leave no trace.
                called("fmi3GetFMUState", ran, ctypes.byref(saved))
                called("fmi3SerializedFMUStateSize", ran, saved, ctypes.byref(size))
                kept = ctypes.create_string_buffer(size.value)
                called("fmi3SerializeFMUState", ran, saved, kept, size)
                called("fmi3FreeFMUState", ran, ctypes.byref(saved))
                if step(ran, 50 * period) != 0:
                    sys.exit("fmi3DoStep failed")
                called("fmi3DeserializeFMUState", ran, kept, size, ctypes.byref(none))
                called("fmi3SetFMUState", ran, none)
                called("fmi3FreeFMUState", ran, ctypes.byref(none))
            for name in inputs:
                value[0] = row[name]
                called("fmi3SetFloat64", ran, one(references[name]), count, value, count)
            called("fmi3GetFloat64", ran, one(references["y"]), count, value, count)
            readings.append(value[0])
            if step(ran, period) != 0 or step(other, 3 * period) != 0:
                sys.exit("fmi3DoStep failed")
        for instance in (ran, other):
            library.fmi3FreeInstance(instance)
        return np.array(readings)


found = by_fmpy() if "--fmpy" in sys.argv else by_its_library()
if len(found) != len(expected):
    sys.exit(f"{len(found)} readings for {len(expected)} samples")
judged = np.ones(len(found), bool)
if "--fmpy" in sys.argv:
    # FMPy notes outputs before it sets the inputs of that time: what goes straight through is then of the sample before.
    for name in inputs:
        judged[1:] &= np.diff(record[name]) == 0.0
worst = np.abs(found - expected)[judged].max()
print(f"{judged.sum()} samples, largest difference {worst:.3g}")
sys.exit(0 if worst == 0.0 else "the FMU gives other readings than the host")
