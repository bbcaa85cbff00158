"""What other optimisers make of the same delay problem: NOMAD and a genetic search.

Usage: search_peers.py SET.csv SEEDS
SET.csv has columns record,u,y. Prints one line per run, like our own program:
method,problem,seed,evaluations,value,CPU seconds.

The model is the paper's (N1 = 5, N2 = 10, N3 = 1, lags as printed, law (2) given,
lags 1..500). The objective is written here from the equations: least squares for
the coefficients, then the one-step residual norm or the free-run error.
"""

import sys
import time

import numpy as np
from numba import njit
from scipy.optimize import differential_evolution

N1, N2, LONGEST, WINDOW = 5, 10, 500, 250


def load(path):
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return [table[table[:, 0] == r, 1:] for r in np.unique(table[:, 0])]


def arrived(u, y):
    """u_{k-h(ytil_k)} from the measured output."""
    sums = np.concatenate([[0.0], np.cumsum(y)])
    k = np.arange(len(y))
    mean = (sums[k] - sums[np.maximum(k - WINDOW + 1, 0)]) / WINDOW
    law = 47.35 + 12.69 * np.exp(-20.18 * np.maximum(mean, 0.0))
    source = k - np.floor(law + 0.5).astype(int)
    return np.where(source >= 0, u[np.maximum(source, 0)], 0.0)


class Problem:
    def __init__(self, records, free_run):
        self.free_run = free_run
        self.u = np.array([r[:, 0] for r in records])
        self.y = np.array([r[:, 1] for r in records])
        self.padded = np.pad(self.y, ((0, 0), (LONGEST, 0)))
        self.d = np.concatenate([arrived(u, y)[:-1] for u, y in zip(self.u, self.y)])
        self.target = self.y[:, 1:].ravel()
        self.known = {}
        self.evaluations = 0

    def lagged(self, lag):
        n = self.y.shape[1] - 1
        return self.padded[:, LONGEST - lag : LONGEST - lag + n].ravel()

    def __call__(self, x):
        x = np.rint(np.asarray(x)).astype(int)
        state, product = sorted(set(x[:N1])), sorted(set(x[N1:]))
        key = (tuple(state), tuple(product))
        if key not in self.known:
            self.evaluations += 1
            self.known[key] = self.evaluate(state, product)
        return self.known[key]

    def evaluate(self, state, product):
        columns = [self.lagged(lag) for lag in state] + [self.d]
        columns += [self.d * self.lagged(lag) for lag in product]
        a = np.array(columns)
        theta = np.linalg.lstsq(a @ a.T, a @ self.target, rcond=1e-14)[0]
        if not self.free_run:
            return float(np.linalg.norm(self.target - theta @ a))
        lags = np.array(state), np.array(product)
        value = simulate(self.u, self.y, *lags, theta)
        return float(np.sqrt(value)) if np.isfinite(value) else 1e6


@njit
def simulate(u, y, state, product, theta):
    total = 0.0
    samples = y.shape[1]
    s = np.zeros(samples)
    for r in range(y.shape[0]):
        running = 0.0
        s[0] = 0.0
        total += y[r, 0] ** 2
        for k in range(samples - 1):
            mean = max(running / WINDOW, 0.0)
            h = int(np.floor(47.35 + 12.69 * np.exp(-20.18 * mean) + 0.5))
            value = 0.0
            for i in range(len(state)):
                if k >= state[i]:
                    value += theta[i] * s[k - state[i]]
            if k >= h and u[r, k - h] != 0.0:
                value += theta[len(state)]
                for j in range(len(product)):
                    if k >= product[j]:
                        value += theta[len(state) + 1 + j] * s[k - product[j]]
            if not abs(value) < 10.0:
                return np.inf
            running += s[k]
            if k >= WINDOW - 1:
                running -= s[k - WINDOW + 1]
            s[k + 1] = value
            total += (y[r, k + 1] - value) ** 2
    return total


def start(seed):
    """NOMAD keeps a diverged start: take the best of a few draws."""
    rng = np.random.default_rng(seed)
    return [rng.integers(1, LONGEST + 1, N1 + N2) for _ in range(20)]


def nomad(problem, seed, options, budget):
    import PyNomad

    first = min(start(seed), key=problem).tolist()

    def blackbox(x):
        value = problem([x.get_coord(i) for i in range(x.size())])
        x.setBBO(str(value).encode())
        return 1

    n = N1 + N2
    PyNomad.optimize(
        blackbox, first, [1] * n, [LONGEST] * n,
        ["BB_OUTPUT_TYPE OBJ", "BB_INPUT_TYPE (" + " I" * n + " )", f"MAX_BB_EVAL {budget}",
         "DISPLAY_DEGREE 0", f"SEED {seed}"] + options,
    )


def genetic(problem, seed, budget):
    generations = budget // (4 * (N1 + N2)) - 1
    differential_evolution(
        problem, [(1, LONGEST)] * (N1 + N2), integrality=[True] * (N1 + N2), popsize=4, polish=False,
        maxiter=generations, tol=0, rng=seed,
    )


def main():
    records = load(sys.argv[1])
    methods = {
        "NOMAD 4.6 defaults": lambda p, s: nomad(p, s, [], 4545),
        "NOMAD 4.6 poll only": lambda p, s: nomad(
            p, s, ["QUAD_MODEL_SEARCH no", "NM_SEARCH no", "DIRECTION_TYPE ORTHO 2N"], 4545),
        "differential evolution": lambda p, s: genetic(p, s, 5200),
    }
    Problem(records, True)(start(0)[0])  # compiles the simulation
    for free_run in (False, True):
        for name, method in methods.items():
            for seed in range(int(sys.argv[2])):
                problem = Problem(records, free_run)
                before = time.process_time()
                method(problem, seed)
                spent = time.process_time() - before
                best = min(problem.known.values())
                label = "free-run/law" if free_run else "one-step/law"
                print(f"{name},{label},{seed},{problem.evaluations},{best:.6f},{spent:.2f}", flush=True)


if __name__ == "__main__":
    main()
