"""Input for `cargo xtask memory`, and the peak memory of a command.

    measure.py make FOLDER
    measure.py run SECONDS PROGRAM ARGUMENTS
"""

import json
import os
import resource
import struct
import subprocess
import sys
import time
import zipfile
import zlib

# No command may take the machine's memory, whatever it does.
MOST = 8 << 30
ROWS = 10_000_000


def records(folder, name, rows):
    """A data set of one first-order record, written block by block."""
    os.makedirs(os.path.join(folder, name), exist_ok=True)
    seed, level, left, on = 1, 0.0, 100, 0
    with open(os.path.join(folder, name, "long.csv"), "w") as file:
        file.write("t,u,y\n")
        block = []
        for k in range(rows):
            seed = (seed * 1664525 + 1013904223) & 0xFFFFFFFF
            if left == 0:
                on, left = 1 - on, 100 + (seed >> 8) % 400
            left -= 1
            level += 0.01 * (on - level)
            block.append(f"{k * 0.001:.3f},{on},{level + (seed >> 16) * 1e-7:.5f}\n")
            if len(block) == 100_000:
                file.write("".join(block))
                block = []
        file.write("".join(block))
    with open(os.path.join(folder, name, "dataset.toml"), "w") as file:
        file.write("sample_period_s = 0.001\n")
        file.write('[[record]]\nname = "long"\nfile = "long.csv"\nuse = "identify"\n')


def wide(path, columns, rows):
    with open(path, "w") as file:
        file.write("t,u,y," + ",".join(f"c{i}" for i in range(columns - 3)) + "\n")
        rest = ",1.25" * (columns - 3)
        for k in range(rows):
            file.write(f"{k * 0.001:.3f},{k // 50 % 2},{k % 7}{rest}\n")


def zeros(packer, bytes_, file):
    """Packed zeros."""
    block = bytes(1 << 20)
    for _ in range(bytes_ >> 20):
        file.write(packer.compress(block))
    file.write(packer.flush())


def mat(path, values, packed):
    """A MATLAB v5 file with one variable y of uint8, which takes 8 bytes a value when read."""
    name = b"y\0\0\0\0\0\0\0"
    head = struct.pack("<IIII", 6, 8, 9, 0)
    head += struct.pack("<IIii", 5, 8, 1, values)
    head += struct.pack("<II", 1, 1) + name
    head += struct.pack("<II", 2, values)
    whole = struct.pack("<II", 14, len(head) + values) + head
    with open(path, "wb") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
        if not packed:
            file.write(whole)
            return
        at = file.tell()
        file.write(struct.pack("<II", 15, 0))
        packer = zlib.compressobj(1)
        file.write(packer.compress(whole))
        zeros(packer, values, file)
        end = file.tell()
        file.seek(at)
        file.write(struct.pack("<II", 15, end - at - 8))


def npz(path, values):
    """A NumPy archive with one array y of zeros."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({values},), }}"
    header = header.ljust(117) + "\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        with archive.open("y.npy", "w", force_zip64=True) as file:
            file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode())
            block = bytes(1 << 20)
            for _ in range((values * 8) >> 20):
                file.write(block)


def make(folder):
    records(folder, "most", ROWS)
    records(folder, "more", 2 * ROWS)
    records(folder, "million", ROWS // 10)
    wide(os.path.join(folder, "most.csv"), 4_099, 2_000)
    wide(os.path.join(folder, "wide.csv"), 16_384, 500)
    wide(os.path.join(folder, "wider.csv"), 16_385, 20)
    wide(os.path.join(folder, "header.csv"), 1_000_000, 1)
    with open(os.path.join(folder, "line.csv"), "w") as file:
        file.write("t,u,y\n" + "1" * 300_000_000)
    mat(os.path.join(folder, "short.mat"), 2_000_000_000, False)
    mat(os.path.join(folder, "bomb.mat"), 2_000_000_000, True)
    npz(os.path.join(folder, "bomb.npz"), 2_000_000_000)


def run(seconds, line):
    resource.setrlimit(resource.RLIMIT_AS, (MOST, MOST))
    started = time.time()
    try:
        done = subprocess.run(
            line, timeout=seconds, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        code, said = done.returncode, done.stderr.decode("utf-8", "replace")
    except subprocess.TimeoutExpired:
        code, said = None, ""
    print(
        json.dumps(
            {
                "code": code,
                "said": said[-2000:],
                "seconds": time.time() - started,
                # Linux counts in KiB.
                "bytes": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024,
            }
        )
    )


if sys.argv[1] == "make":
    make(sys.argv[2])
else:
    run(float(sys.argv[2]), sys.argv[3:])
