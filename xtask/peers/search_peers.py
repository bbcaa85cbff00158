"""One delay problem, several optimisers: host-fit, NOMAD and a genetic search.

Usage: search_peers.py --dataset DIR --host-fit PROGRAM --seeds N --evaluations N --seconds N [--ours]
DATASET is a folder with dataset.toml. Prints one line per run:
method,problem,seed,evaluations,value,CPU seconds,end
where end says whether the method ended by "itself", at the number of "evaluations"
or at the "time" it was allowed, or was "broken off" by an error of its own (evaluations and time
are then those of its last improvement). CPU seconds of the peers leave out loading and tables;
those of host-fit are of its whole process.

The model is the paper's (N1 = 5, N2 = 10, N3 = 1, lags 1..500 as printed, law (2)
given, f = 1). The peers' objective is written here from the equations, and made fast so
that the comparison is of the searches: lagged products are tabulated once, so the
least squares are look-ups and a 16 x 16 solve, and the free run is compiled.
"""

import argparse
import concurrent.futures
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import tomllib

import numpy as np
from numba import njit
from scipy.optimize import differential_evolution

N1, N2, LONGEST, WINDOW = 5, 10, 500, 250
DIVERGED = 1e6


def load(folder):
    """u and y of the identify records, which are equally long, one row each."""
    folder = pathlib.Path(folder)
    description = tomllib.loads((folder / "dataset.toml").read_text())
    u, y = [], []
    for record in description["record"]:
        if record["use"] == "identify":
            with open(folder / record["file"], newline="") as file:
                rows = list(csv.DictReader(file))
            u.append([float(row["u"]) for row in rows])
            y.append([float(row["y"]) for row in rows])
    return np.array(u), np.array(y)


def arrived(u, y):
    """u_{k-h(ytil_k)} from the measured output."""
    sums = np.concatenate([[0.0], np.cumsum(y)])
    k = np.arange(len(y))
    mean = (sums[k] - sums[np.maximum(k - WINDOW + 1, 0)]) / WINDOW
    law = 47.35 + 12.69 * np.exp(-20.18 * np.maximum(mean, 0.0))
    source = k - np.floor(law + 0.5).astype(int)
    return np.where(source >= 0, u[np.maximum(source, 0)], 0.0)


@njit(cache=True)
def lagged_products(y, weight):
    """T[i, j] = sum_k w_k z_i z_j with z_0 = y_{k+1}, z_i = y_{k-i}, and z_{LONGEST+1} = 1."""
    size = LONGEST + 2
    table = np.zeros((size, size))
    column = np.zeros(size)
    for r in range(y.shape[0]):
        for k in range(y.shape[1] - 1):
            if weight[r, k] == 0.0:
                continue
            column[0] = y[r, k + 1]
            for i in range(1, size - 1):
                column[i] = y[r, k - i] if k >= i else 0.0
            column[size - 1] = 1.0
            for i in (0, 1, size - 1):
                for j in range(size):
                    table[i, j] += weight[r, k] * column[i] * column[j]
    # Each diagonal follows from its first entry: the next one is shifted by a
    # sample, which matters only where the weight changes and at the ends.
    for r in range(y.shape[0]):
        last = y.shape[1] - 2
        for k in range(-1, last + 1):
            now = weight[r, k] if k >= 0 else 0.0
            after = weight[r, k + 1] if k < last else 0.0
            if now == after:
                continue
            for i in range(1, size - 2):
                for j in range(i, size - 2):
                    if k >= j:
                        table[i + 1, j + 1] += (after - now) * y[r, k - i] * y[r, k - j]
    for i in range(1, size - 2):
        for j in range(i, size - 2):
            table[i + 1, j + 1] += table[i, j]
    for i in range(size):
        for j in range(i):
            if i < size - 1 and j >= 1:
                table[i, j] = table[j, i]
    for j in range(size):
        table[j, 0] = table[0, j]
        table[j, size - 1] = table[size - 1, j]
    return table


@njit(cache=True)
def least_squares(plain, on, state, product):
    """Coefficients of (8) and the squared residual norm, from the tables."""
    n = len(state) + 1 + len(product)
    element = np.empty(n, np.int64)
    element[: len(state)] = state
    element[len(state)] = LONGEST + 1
    element[len(state) + 1 :] = product
    gram = np.empty((n, n))
    right = np.empty(n)
    for i in range(n):
        right[i] = (plain if i < len(state) else on)[element[i], 0]
        for j in range(n):
            both = i < len(state) and j < len(state)
            gram[i, j] = (plain if both else on)[element[i], element[j]]
    theta = np.linalg.lstsq(gram, right, 1e-14)[0]
    return theta, plain[0, 0] - theta @ right


@njit(cache=True)
def simulate(u, y, state, product, theta):
    total = 0.0
    samples = y.shape[1]
    s = np.zeros(samples)
    inputs = len(state)
    for r in range(y.shape[0]):
        running = 0.0
        s[0] = 0.0
        total += y[r, 0] ** 2
        for k in range(samples - 1):
            mean = max(running / WINDOW, 0.0)
            h = int(np.floor(47.35 + 12.69 * np.exp(-20.18 * mean) + 0.5))
            value = 0.0
            for i in range(inputs):
                if k >= state[i]:
                    value += theta[i] * s[k - state[i]]
            if k >= h and u[r, k - h] != 0.0:
                value += theta[inputs]
                for j in range(len(product)):
                    if k >= product[j]:
                        value += theta[inputs + 1 + j] * s[k - product[j]]
            if not abs(value) < 10.0:
                return np.inf
            running += s[k]
            if k >= WINDOW - 1:
                running -= s[k - WINDOW + 1]
            s[k + 1] = value
            total += (y[r, k + 1] - value) ** 2
    return total


class BudgetSpent(Exception):
    """The method has had what it is allowed."""


class Problem:
    """The objective, with a memory of what was evaluated: duplicates are free."""

    def __init__(self, tables, free_run, evaluations, seconds, report):
        self.u, self.y, self.plain, self.on = tables
        self.free_run = free_run
        self.known = {}
        self.best = DIVERGED
        self.allowed = evaluations, seconds
        self.report = report
        self.started = time.process_time()

    def spent(self):
        return time.process_time() - self.started

    def ended(self):
        evaluations, seconds = self.allowed
        # NOMAD counts a few duplicates that are free here.
        if len(self.known) >= 0.99 * evaluations:
            return "evaluations"
        return "time" if self.spent() >= 0.99 * seconds else "itself"

    def __call__(self, x):
        x = np.rint(np.asarray(x)).astype(np.int64)
        state, product = np.unique(x[:N1]), np.unique(x[N1:])
        key = (tuple(state), tuple(product))
        if key in self.known:
            return self.known[key]
        evaluations, seconds = self.allowed
        if len(self.known) >= evaluations or self.spent() >= seconds:
            raise BudgetSpent
        theta, residual = least_squares(self.plain, self.on, state, product)
        if self.free_run:
            residual = simulate(self.u, self.y, state, product, theta)
        value = float(np.sqrt(max(residual, 0.0))) if np.isfinite(residual) else DIVERGED
        self.known[key] = value
        if value < self.best:
            self.best = value
            # Should the method break off or be ended from outside, this is its result.
            self.report(self, "broken off")
        return value


def first_point(problem, seed):
    """The first draw that does not diverge: NOMAD does not find out of those that do."""
    rng = np.random.default_rng(seed)
    while True:
        point = rng.integers(1, LONGEST + 1, N1 + N2)
        if problem(point) < DIVERGED:
            return point.tolist()


def nomad(problem, seed, options):
    import PyNomad

    n = N1 + N2
    start = first_point(problem, seed)

    def blackbox(x):
        try:
            value = problem([x.get_coord(i) for i in range(n)])
        except BudgetSpent:
            # NOMAD cannot be left by an exception.
            problem.report(problem, problem.ended())
            os._exit(0)
        x.setBBO(str(value).encode())
        return 1

    PyNomad.optimize(
        blackbox, start, [1] * n, [LONGEST] * n,
        ["BB_OUTPUT_TYPE OBJ", "BB_INPUT_TYPE (" + " I" * n + " )", "DISPLAY_DEGREE 0",
         f"MAX_BB_EVAL {problem.allowed[0]}", f"SEED {seed}"] + options,
    )


def genetic(problem, seed):
    try:
        differential_evolution(
            problem, [(1, LONGEST)] * (N1 + N2), integrality=[True] * (N1 + N2), popsize=4,
            polish=False, maxiter=100_000, rng=seed,
        )
    except BudgetSpent:
        pass


PEERS = {
    "NOMAD 4.6 defaults": lambda p, s: nomad(p, s, []),
    "NOMAD 4.6 poll only": lambda p, s: nomad(
        p, s, ["QUAD_MODEL_SEARCH no", "NM_SEARCH no", "DIRECTION_TYPE ORTHO 2N"]),
    "differential evolution": genetic,
}
OURS = "host-fit"


def line(method, objective, seed, evaluations, value, seconds, end):
    return f"{method},{objective},{seed},{evaluations},{value:.6f},{seconds:.2f},{end}"


def run_peer(arguments):
    """One run of one peer, in this process."""
    u, y = load(arguments.dataset)
    everywhere = np.ones((y.shape[0], y.shape[1] - 1))
    on = np.array([arrived(u, y)[:-1] for u, y in zip(u, y)])
    tables = u, y, lagged_products(y, everywhere), lagged_products(y, on)
    Problem(tables, True, 1, 1e9, lambda *_: None)(range(1, 16))  # compiles
    method, objective, seed = arguments.one.split(",")

    def report(problem, end):
        print(line(method, objective, seed, len(problem.known), problem.best, problem.spent(), end),
              flush=True)

    problem = Problem(
        tables, objective == "free-run", arguments.evaluations, arguments.seconds, report)
    PEERS[method](problem, int(seed))
    report(problem, problem.ended())


def run_ours(arguments, objective, seed):
    with tempfile.TemporaryDirectory() as folder:
        command = [
            arguments.host_fit, "identify", arguments.dataset, "-o", folder + "/model.toml", "--json",
            "--seed", str(seed), "--objective", objective, "--lags", "literal",
            "--delay-law", "47.35,12.69,20.18", "--factors", "1",
        ]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        found = json.loads(process.stdout.read())
        _, _, used = os.wait4(process.pid, 0)
    return line(OURS, objective, seed, found["evaluations"], found["objective_value"],
                used.ru_utime + used.ru_stime, "itself")


def run_one(arguments, method, objective, seed):
    """One run in a process of its own: NOMAD can end its process, or not end at all."""
    if method == OURS:
        return run_ours(arguments, objective, seed)
    command = [sys.executable, __file__, *sys.argv[1:], "--one", f"{method},{objective},{seed}"]
    try:
        # Processor time is what is allowed; on a busy machine it takes longer.
        lines = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            timeout=60 + 3 * arguments.seconds).stdout
    except subprocess.TimeoutExpired as expired:
        lines = (expired.stdout or b"").decode().replace(",broken off", ",time")
    results = [text for text in lines.splitlines() if text.startswith(method + ",")]
    return results[-1] if results else line(method, objective, seed, 0, DIVERGED, 0.0, "failed")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dataset", required=True)
    parser.add_argument("--host-fit", required=True)
    parser.add_argument("--seeds", type=int, required=True)
    parser.add_argument("--evaluations", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--ours", action="store_true")
    parser.add_argument("--one")
    arguments = parser.parse_args()
    if arguments.one:
        run_peer(arguments)
        return
    runs = [
        (method, objective, seed)
        for objective in ("one-step", "free-run")
        for method in ([OURS] if arguments.ours else [OURS, *PEERS])
        for seed in range(arguments.seeds)
    ]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        for result in pool.map(lambda run: run_one(arguments, *run), runs):
            print(result, flush=True)


if __name__ == "__main__":
    main()
