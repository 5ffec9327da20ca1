"""Fit the logistic maps of turnmill_core/monitoring/confidence.py on random simulated cuts, and test them on others.

    python -m tools.calibrate_confidence [--train 400] [--test 200]

Prints the table WEIGHTS, and for cuts that were not used to fit: how often verdicts of each stated probability were
right. The verdict's other fields do not depend on the weights.
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np
from scipy import optimize

from tools.corpus import make, right, run
from turnmill_core.monitoring import window
from turnmill_core.monitoring.confidence import EVIDENCE, WEIGHTS
from turnmill_core.monitoring.verdict import ChatterKind

FIRST_TEST = 10_000
SHRINK = 0.02
TOGETHER = ((ChatterKind.AIR,), (ChatterKind.STABLE,), (ChatterKind.MARGINAL,), (ChatterKind.HOPF,),
            (ChatterKind.FLIP, ChatterKind.FLIP_OR_RUNOUT))
"""States that share a map (flip needs an odd number of teeth and is rare by itself)."""


def rows(number: int) -> list[tuple[int, float, np.ndarray]]:
    """State, right or wrong, evidence, for every verdict on a case that can be told right from wrong."""
    seen: list[np.ndarray] = []
    evidence = window.evidence

    def watched(*arguments: object) -> np.ndarray:
        seen.append(evidence(*arguments))
        return seen[-1]

    window.evidence = watched
    try:
        heard = run(make(number))
    finally:
        window.evidence = evidence
    judged = [k for k, v in enumerate(heard.verdicts) if math.isfinite(v.asynchronous_ratio)]
    truth = {kind: right(kind, heard) for kind in ChatterKind}
    found = [(heard.verdicts[k].state, e, k) for k, e in zip(judged, seen, strict=True)]
    return [(int(state), truth[state][k], e) for state, e, k in found if math.isfinite(truth[state][k])]


def gather(first: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """States, right or wrong, evidence and case number of all verdicts on cases first ... first + count - 1."""
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(rows, range(first, first + count), chunksize=4))
    flat = [(s, r, e, n) for n, case in enumerate(found) for s, r, e in case]
    return (np.array([f[0] for f in flat]), np.array([f[1] for f in flat]), np.array([f[2] for f in flat]),
            np.array([f[3] for f in flat]))


def fit(evidence: np.ndarray, outcome: np.ndarray) -> np.ndarray:
    """Weights of least logistic loss, shrunk towards zero (all but the constant); outcomes with two doubts added."""
    doubt = 1 / (len(outcome) + 2)
    outcome = doubt + (1 - 2 * doubt) * outcome

    def loss(w: np.ndarray) -> float:
        z = evidence @ w
        return float(np.mean(np.logaddexp(0, z) - outcome * z) + SHRINK * np.sum(w[1:] ** 2) / 10)

    return np.asarray(optimize.minimize(loss, np.zeros(evidence.shape[1]), method="BFGS").x)


def reliability(probability: np.ndarray, outcome: np.ndarray) -> tuple[float, list[tuple[float, float, int]]]:
    """Expected calibration error, and per bin: mean probability, share right, count."""
    edges = np.array([0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0 + 1e-9])
    bins, error = [], 0.0
    for low, high in pairwise(edges):
        at = (probability >= low) & (probability < high)
        if at.any():
            bins.append((float(probability[at].mean()), float(outcome[at].mean()), int(at.sum())))
            error += at.mean() * abs(bins[-1][0] - bins[-1][1])
    return error, bins


def main() -> None:
    """Fit, print, test."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", type=int, default=400)
    parser.add_argument("--test", type=int, default=200)
    parser.add_argument("--keep", action="store_true", help="test the present weights, fit none")
    args = parser.parse_args()
    weights = dict(WEIGHTS)
    if not args.keep:
        state, outcome, evidence, _ = gather(0, args.train)
        print("WEIGHTS: dict[ChatterKind, tuple[float, ...]] = {\n    # " + ", ".join(EVIDENCE))
        for kinds in TOGETHER:
            at = np.isin(state, kinds)
            found = tuple(float(round(x, 2)) for x in fit(evidence[at], outcome[at]))
            print(f"    # {at.sum()} verdicts, {100 * outcome[at].mean():.1f} % right")
            for kind in kinds:
                weights[kind] = found
                print(f"    ChatterKind.{kind.name}: {found},")
        print("}")
    state, outcome, evidence, _ = gather(FIRST_TEST, args.test)
    table = np.array([weights.get(ChatterKind(s), (0.0,) * len(EVIDENCE)) for s in state])
    probability = 1 / (1 + np.exp(-np.sum(table * evidence, axis=1)))
    error, bins = reliability(probability, outcome)
    print(f"test: {len(outcome)} verdicts of {args.test} cuts, {100 * outcome.mean():.1f} % right, "
          f"calibration error {error:.3f}")
    for mean, share, count in bins:
        print(f"  stated {mean:.3f}   right {share:.3f}   {count}")
    for kind in weights:
        at = state == kind
        if at.any():
            print(f"  {kind.name}: {at.sum()} verdicts, stated {probability[at].mean():.3f}, "
                  f"right {outcome[at].mean():.3f}")


if __name__ == "__main__":
    main()
