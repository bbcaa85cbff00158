"""What other optimisers make of the same delay problem: NOMAD and a genetic search.

Usage: search_peers.py DATASET SEEDS EVALUATIONS SECONDS
DATASET is a folder with dataset.toml. Prints one line per run:
method,problem,seed,evaluations,value,CPU seconds,stopped
where stopped says whether the method ended by itself ("itself"), at EVALUATIONS
("evaluations") or after SECONDS of processor time ("time").

The model is the paper's (N1 = 5, N2 = 10, N3 = 1, lags 1..500 as printed, law (2)
given, f = 1). The objective is written here from the equations, and made fast so
that the comparison is of the searches: lagged products are tabulated once, so the
least squares are look-ups and a 16 x 16 solve, and the free run is compiled.
"""

import csv
import pathlib
import sys
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

    def __init__(self, tables, free_run, evaluations, seconds):
        self.u, self.y, self.plain, self.on = tables
        self.free_run = free_run
        self.known = {}
        self.allowed = evaluations, seconds
        self.started = time.process_time()
        self.stopped = "itself"

    def spent(self):
        return time.process_time() - self.started

    def __call__(self, x):
        x = np.rint(np.asarray(x)).astype(np.int64)
        state, product = np.unique(x[:N1]), np.unique(x[N1:])
        key = (tuple(state), tuple(product))
        if key in self.known:
            return self.known[key]
        evaluations, seconds = self.allowed
        if len(self.known) >= evaluations:
            self.stopped = "evaluations"
        elif self.spent() >= seconds:
            self.stopped = "time"
        if self.stopped != "itself":
            raise BudgetSpent
        theta, residual = least_squares(self.plain, self.on, state, product)
        if self.free_run:
            residual = simulate(self.u, self.y, state, product, theta)
        value = float(np.sqrt(max(residual, 0.0))) if np.isfinite(residual) else DIVERGED
        self.known[key] = value
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

    def blackbox(x):
        try:
            x.setBBO(str(problem([x.get_coord(i) for i in range(n)])).encode())
        except BudgetSpent:
            # NOMAD cannot be left by an exception: it ends on its own limit.
            x.setBBO(str(DIVERGED).encode())
            return 0
        return 1

    evaluations, seconds = problem.allowed
    PyNomad.optimize(
        blackbox, first_point(problem, seed), [1] * n, [LONGEST] * n,
        ["BB_OUTPUT_TYPE OBJ", "BB_INPUT_TYPE (" + " I" * n + " )", f"MAX_BB_EVAL {evaluations}",
         f"MAX_TIME {int(seconds)}", "DISPLAY_DEGREE 0", f"SEED {seed}"] + options,
    )
    if len(problem.known) >= evaluations:
        problem.stopped = "evaluations"
    elif problem.spent() >= 0.98 * seconds:
        problem.stopped = "time"


def genetic(problem, seed):
    try:
        differential_evolution(
            problem, [(1, LONGEST)] * (N1 + N2), integrality=[True] * (N1 + N2), popsize=4,
            polish=False, maxiter=100_000, rng=seed,
        )
    except BudgetSpent:
        pass


METHODS = {
    "NOMAD 4.6 defaults": lambda p, s: nomad(p, s, []),
    "NOMAD 4.6 poll only": lambda p, s: nomad(
        p, s, ["QUAD_MODEL_SEARCH no", "NM_SEARCH no", "DIRECTION_TYPE ORTHO 2N"]),
    "differential evolution": genetic,
}


def main():
    folder, seeds, evaluations, seconds = sys.argv[1:5]
    u, y = load(folder)
    everywhere = np.ones((y.shape[0], y.shape[1] - 1))
    on = np.array([arrived(u, y)[:-1] for u, y in zip(u, y)])
    tables = u, y, lagged_products(y, everywhere), lagged_products(y, on)
    Problem(tables, True, 1, 1e9)(range(1, 16))  # compiles
    chosen = sys.argv[5:] or METHODS
    for free_run in (False, True):
        for name in chosen:
            for seed in range(int(seeds)):
                problem = Problem(tables, free_run, int(evaluations), float(seconds))
                METHODS[name](problem, seed)
                label = "free-run" if free_run else "one-step"
                print(f"{name},{label},{seed},{len(problem.known)},{min(problem.known.values()):.6f},"
                      f"{problem.spent():.2f},{problem.stopped}", flush=True)


if __name__ == "__main__":
    main()
