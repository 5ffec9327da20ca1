"""Thresholds and densities of the published indicators (turnmill_core/detection/rivals.py), from training numbers.

    python -m tools.fit_baselines [--cuts 20] [--quiet 17] [--parts 5] [--jobs 2]

Prints what RIVALS, STABLE and CHATTER hold. A fitted threshold is the highest that finds 95 % of the Hopf chatters
in time, with the gate and two windows in a row; the densities are those of windows that are heard.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from turnmill_core.detection.comparison import episodes, peak
from turnmill_core.detection.cuts import make_cut
from turnmill_core.detection.endless import QUIET_KINDS, go_on, quiet_motion
from turnmill_core.detection.hearing import Heard, hear_motion, hear_quiet
from turnmill_core.detection.recordings import RATE, Observed, observe, simulate_cut
from turnmill_core.detection.rivals import FITTED, RANGE, RIVALS, concentrations
from turnmill_core.monitoring.entropy import largest_entropy
from turnmill_core.monitoring.verdict import ChatterKind

RECALL = 0.95
"""What is asked of the monitor is asked of them."""

QUIET_CUTS = ("stable", "resonance", "runout")

Row = tuple[Heard, np.ndarray]


def rows(task: tuple[str, int, int]) -> list[Row]:
    """What was heard, and the concentration in every window: of a cut, or of `parts` minutes of a quiet one."""
    kind, number, parts = task
    if parts:
        motion = quiet_motion(kind, number)
        return [row(hear_quiet(kind, number, part, motion), go_on(motion, kind, number, part))
                for part in range(parts)]
    motion = simulate_cut(make_cut(kind, number))
    return [row(hear_motion(motion), observe(motion))]


def row(heard: Heard, seen: Observed) -> Row:
    """What was heard of a signal, and its concentrations."""
    return heard, concentrations(seen, [round(t * RATE) + 1 for t in heard.ends])


def main() -> None:
    """Hear, fit, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cuts", type=int, default=20, help="cuts of every kind without chatter; with, four times")
    parser.add_argument("--quiet", type=int, default=17, help="quiet cuts that go on")
    parser.add_argument("--parts", type=int, default=5, help="minutes of each")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    tasks = [(kind, n, 0) for kind in QUIET_CUTS for n in range(args.cuts)]
    tasks += [("chatter", n, 0) for n in range(4 * args.cuts)]
    tasks += [(QUIET_KINDS[n % len(QUIET_KINDS)], n, args.parts) for n in range(args.quiet)]
    with ProcessPoolExecutor(args.jobs) as pool:
        report([r for found in pool.map(rows, tasks, chunksize=4) for r in found])


def report(found: list[Row]) -> None:
    """Print thresholds and densities."""
    asked = episodes([h for h, _ in found], ChatterKind.HOPF)
    for k, rival in enumerate(RIVALS, start=1):
        if rival.source == FITTED:
            peaks = np.sort([peak(h, k) for h in asked])[::-1]
            print(f"{rival.name}: {peaks[int(np.ceil(RECALL * len(peaks))) - 1]:.3f} finds {100 * RECALL:.0f} % of "
                  f"{len(peaks)}")
    for name, kind in (("STABLE", ChatterKind.STABLE), ("CHATTER", ChatterKind.HOPF)):
        values = np.concatenate([c[(h.truth == int(kind)) & (h.scores[:, 1] > 0)] for h, c in found])
        density = largest_entropy(values, *RANGE)
        print(f"{name} = Density(*RANGE, {tuple(float(round(c, 2)) for c in density.coefficients)})  "
              f"# {len(values)} windows")


if __name__ == "__main__":
    main()
