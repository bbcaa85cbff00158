"""Simulates the exported model over a record: python3 free_run.py RECORD.csv, with flow.py from `host-fit codegen --lang python`."""

import sys

import numpy as np

import flow

record = np.genfromtxt(sys.argv[1], delimiter=",", names=True)
y = flow.Model().simulate(record["u"])
error = record["y"] - y
fit = 100.0 * (1.0 - np.linalg.norm(error) / np.linalg.norm(record["y"] - record["y"].mean()))
print(f"FIT {fit:.2f} %")
try:
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit()
plt.plot(record["t"], record["y"], label="measured")
plt.plot(record["t"], y, label=f"model, FIT {fit:.1f} %")
plt.xlabel("t, s")
plt.legend()
plt.savefig("free_run.png")
