"""Fit the logistic maps of turnmill_core/monitoring/confidence.py on training cuts of the corpus; test them on others.

    python -m tools.calibrate_confidence [--train 24] [--test 12] [--jobs 2]

Prints the table WEIGHTS, and for cuts that were not used to fit: how often verdicts of each stated probability were
right. The verdict's other fields do not depend on the weights.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np
from scipy import optimize

from turnmill_core.detection.cuts import KINDS, TRAIN_END, make_cut
from turnmill_core.detection.hearing import listen
from turnmill_core.detection.recordings import observe, simulate_cut, true_kinds
from turnmill_core.monitoring import window
from turnmill_core.monitoring.chatter import config_from_operation
from turnmill_core.monitoring.confidence import EVIDENCE, WEIGHTS
from turnmill_core.monitoring.verdict import ChatterKind, Reason

SHRINK = 0.02
TOGETHER = ((ChatterKind.AIR,), (ChatterKind.STABLE,), (ChatterKind.MARGINAL,), (ChatterKind.HOPF,),
            (ChatterKind.FLIP, ChatterKind.FLIP_OR_RUNOUT))
"""States that share a map (flip needs an odd number of teeth and is rare by itself)."""

Row = tuple[int, float, np.ndarray]


def rows(case: tuple[str, int]) -> list[Row]:
    """State, right or wrong, evidence, for every verdict on a case that can be told right from wrong."""
    seen: list[np.ndarray] = []
    evidence = window.evidence

    def watched(*arguments: object) -> np.ndarray:
        seen.append(evidence(*arguments))
        return seen[-1]

    motion = simulate_cut(make_cut(*case))
    observed = observe(motion)
    window.evidence = watched
    try:
        verdicts = listen(config_from_operation(motion.cut.operation), observed)
    finally:
        window.evidence = evidence
    truth = true_kinds(motion.cut, observed, verdicts)
    judged = [k for k, v in enumerate(verdicts) if v.state is not ChatterKind.UNKNOWN]
    found = [(verdicts[k].state, right(verdicts[k].state, verdicts[k].reason, truth[k]), e)
             for k, e in zip(judged, seen[-len(judged):], strict=True)]
    return [(int(state), outcome, e) for state, outcome, e in found if outcome is not None]


def right(state: ChatterKind, reason: Reason, truth: ChatterKind | None) -> float | None:
    """1 where a state is right, 0 where it is wrong, None where that cannot be said.

    MARGINAL is right near the thresholds, where the truth is none; FLIP_OR_RUNOUT wherever it is one of them.
    """
    if state is ChatterKind.MARGINAL:
        return float(truth is None)
    if truth is None:
        return None
    if state is ChatterKind.FLIP_OR_RUNOUT:
        return float(truth in (ChatterKind.FLIP, ChatterKind.STABLE) and reason is not Reason.PERSISTENCE)
    return float(state is truth)


def cases(first: int, count: int) -> list[tuple[str, int]]:
    """`count` cases of every kind."""
    return [(kind, n) for n in range(first, first + count) for kind in KINDS]


def gather(first: int, count: int, jobs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, right or wrong and evidence of all verdicts on `count` cases of every kind from number `first` on."""
    with ProcessPoolExecutor(jobs) as pool:
        flat = [row for case in pool.map(rows, cases(first, count), chunksize=4) for row in case]
    return np.array([f[0] for f in flat]), np.array([f[1] for f in flat]), np.array([f[2] for f in flat])


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
    parser.add_argument("--train", type=int, default=24, help="cases of every kind to fit")
    parser.add_argument("--test", type=int, default=12, help="cases of every kind to test, other training cases")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", action="store_true", help="test the present weights, fit none")
    args = parser.parse_args()
    weights = dict(WEIGHTS)
    if not args.keep:
        state, outcome, evidence = gather(0, args.train, args.jobs)
        print("WEIGHTS: dict[ChatterKind, tuple[float, ...]] = {\n    # " + ", ".join(EVIDENCE))
        for kinds in TOGETHER:
            at = np.isin(state, kinds)
            found = tuple(float(round(x, 2)) for x in fit(evidence[at], outcome[at]))
            print(f"    # {at.sum()} verdicts, {100 * outcome[at].mean():.1f} % right")
            for kind in kinds:
                weights[kind] = found
                print(f"    ChatterKind.{kind.name}: {found},")
        print("}")
    state, outcome, evidence = gather(TRAIN_END // 2, args.test, args.jobs)
    table = np.array([weights.get(ChatterKind(s), (0.0,) * len(EVIDENCE)) for s in state])
    probability = 1 / (1 + np.exp(-np.sum(table * evidence, axis=1)))
    error, bins = reliability(probability, outcome)
    print(f"test: {len(outcome)} verdicts, {100 * outcome.mean():.1f} % right, calibration error {error:.3f}")
    for mean, share, count in bins:
        print(f"  stated {mean:.3f}   right {share:.3f}   {count}")
    for kind in weights:
        at = state == kind
        if at.any():
            print(f"  {kind.name}: {at.sum()} verdicts, stated {probability[at].mean():.3f}, "
                  f"right {outcome[at].mean():.3f}")


if __name__ == "__main__":
    main()
