"""The files of this folder: one short record in each format that `host-fit import` reads, written by the programs that
people have. Made with numpy 2.4.6 and scipy 1.17.1 (any recent version gives files with the same content):

    pip install numpy scipy && python3 make.py
"""

import struct
from pathlib import Path

import numpy as np
from scipy.io import savemat

here = Path(__file__).parent
n = 40
k = np.arange(n)
t = k * 0.001
valve = np.where(k % 8 < 4, 0.02, 4.97)  # V
shear = np.round(0.25 + 0.5 * np.sin(0.3 * k), 4)  # Pa
wind = 9.5 + 0.125 * (k % 3)
variables = {"t": t, "valve": valve, "y": shear, "u_inf": wind}

savemat(here / "v5.mat", variables, do_compression=False)
savemat(here / "v7.mat", variables, do_compression=True, oned_as="column")
savemat(here / "struct.mat", {"run": variables, "note": "a note", "cells": np.array(["a", 1], dtype=object)}, do_compression=True)
savemat(here / "matrix.mat", {"data": np.column_stack([t, valve, shear]), "Ts": 0.001})
savemat(here / "types.mat", {"valve": (valve > 2).astype(np.int16), "y": (shear * 1e4).astype(np.int32), "fs": np.float32(1000), "z": shear + 1j})
np.savez(here / "plain.npz", **variables)
np.savez_compressed(here / "packed.npz", **variables)
np.save(here / "matrix.npy", np.asfortranarray(np.column_stack([t, valve, shear])))
np.save(here / "rows.npy", np.vstack([t, valve, shear]).astype(">f8"))
np.savez(here / "types.npz", t=t.astype(np.float32), u=valve > 2, y=shear.astype(np.float32), objects=np.array([None], dtype=object))
np.save(here / "records.npy", np.array([(0.0, 1.0)], dtype=[("t", "f8"), ("u", "f8")]))

comma = lambda x: repr(float(x)).replace(".", ",")
with open(here / "german.csv", "w", encoding="latin-1", newline="\r\n") as out:
    out.write("Messung 7\n\nZeit [ms];Ventil [V];y [Pa];u_inf [m/s];T [°C]\n")
    for row in zip(k, valve, shear, wind):
        out.write(";".join([str(row[0]), *map(comma, row[1:]), "20,5"]) + "\n")
with open(here / "long.csv", "w", newline="\n") as out:
    out.write("entity_id,state,last_changed\n")
    for i in range(n):
        if i % 4 == 0:
            out.write(f"switch.valve,{'on' if i % 8 else 'off'},2026-03-29T00:00:{i:02d}Z\n")
        out.write(f"sensor.shear,{shear[i]},2026-03-29T00:00:{i:02d}.5Z\n")
with open(here / "tabs.txt", "w", encoding="utf-16") as out:
    out.write("Time\tValve\tShear\nms\tV\tPa\n")
    for row in zip(k, valve, shear):
        out.write("\t".join(map(str, row)) + "\n")


def matlab_style(order):
    """As MATLAB itself saves: doubles stored in the smallest type, names in small elements, either byte order."""
    mark = {"<": b"\x00\x01IM", ">": b"\x01\x00MI"}[order]
    out = b"MATLAB 5.0 MAT-file, by hand".ljust(124) + mark

    def element(kind, data):
        if 0 < len(data) <= 4:
            tag = struct.pack(order + "I", len(data) << 16 | kind)
            return tag + data.ljust(4, b"\0")
        return struct.pack(order + "II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    for name, values in {"u": (valve > 2), "y": k}.items():
        body = element(6, struct.pack(order + "II", 6, 0)) + element(5, struct.pack(order + "ii", n, 1))
        body += element(1, name.encode()) + element(2, bytes(int(v) for v in values))
        out += element(14, body)
    return out


(here / "small-le.mat").write_bytes(matlab_style("<"))
(here / "small-be.mat").write_bytes(matlab_style(">"))
