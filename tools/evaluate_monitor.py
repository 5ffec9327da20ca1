"""The monitor and the published baselines on random simulated cuts that no calibration has seen.

    python -m tools.evaluate_monitor [--count 60] [--first 20000]

Prints the confusion of states, alarms, and for each indicator the area under its ROC curve and the share of chatter
windows that it finds at one false window in a thousand.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from tools.corpus import Heard, make, run, true_kinds
from turnmill_core.monitoring.baselines import fft_energy_ratio, kalman_energy_ratio, once_per_revolution_variance
from turnmill_core.monitoring.decision import CHATTER
from turnmill_core.monitoring.evaluation import alarms, confusion, per_hour, recall_at, roc_area
from turnmill_core.monitoring.verdict import ChatterKind

BASELINES = (fft_energy_ratio, once_per_revolution_variance, kalman_energy_ratio)


def intervals(heard: Heard) -> list[tuple[float, float]]:
    """Times [s] between which the cut truly chatters, or may (no truth): from the window's middle to its end."""
    found: list[tuple[float, float]] = []
    for v, kind in zip(heard.verdicts, true_kinds(heard), strict=True):
        if kind is None or kind in CHATTER:
            found.append(((v.window_start_ns + v.window_end_ns) * 5e-10, v.window_end_ns * 1e-9))
    return found


def judge(number: int) -> dict[str, object]:
    """One case: states, alarms, and the indicators of every window in the cut."""
    heard = run(make(number))
    kinds = true_kinds(heard)
    rate = heard.case.config.sample_rate
    rows = []
    for v, kind in zip(heard.verdicts, kinds, strict=True):
        if kind in (None, ChatterKind.AIR) or not math.isfinite(v.asynchronous_ratio):
            continue
        x = heard.samples[round(v.window_start_ns * 1e-9 * rate): v.last_sample + 1]
        speed = v.spindle_speed / (2 * math.pi)
        ours = max(v.asynchronous_ratio, v.half_order_ratio) if v.state is not ChatterKind.AIR else 0.0
        rows.append((kind in CHATTER, ours, *(b(x, float(rate), speed) for b in BASELINES)))
    return {"kinds": kinds, "states": [v.state for v in heard.verdicts], "rows": rows,
            "alarms": alarms(heard.verdicts, intervals(heard))}


def main() -> None:
    """Run, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--first", type=int, default=20_000)
    args = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(judge, range(args.first, args.first + args.count), chunksize=2))
    counts: Counter[tuple[ChatterKind, ChatterKind]] = Counter()
    for case in found:
        counts.update(confusion(case["kinds"], case["states"]))
    print("windows by true state (rows) and verdict:")
    for true in ChatterKind:
        row = {f.name: counts[true, f] for f in ChatterKind if counts[true, f]}
        if row:
            print(f"  {true.name:15s}", row)
    rate, hours = per_hour([case["alarms"] for case in found])
    print(f"false alarms: {sum(len(case['alarms'].false) for case in found)} in {hours:.3f} h ({rate:.1f} per hour)")
    rows = np.array([r for case in found for r in case["rows"]])
    print("indicator                        ROC area   recall at 0.1 % false")
    for k, name in enumerate(("ours", *(b.__name__ for b in BASELINES)), start=1):
        print(f"  {name:30s} {roc_area(rows[:, 0], rows[:, k]):8.4f}   {recall_at(rows[:, 0], rows[:, k], 1e-3):8.3f}")


if __name__ == "__main__":
    main()
