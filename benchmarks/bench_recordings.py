"""Recordings: how fast they are read, decoded and analysed without ROS.

    python benchmarks/bench_recordings.py [--json]

The shipped demonstration (two channels at 12.8 kHz); CPU seconds, best of three after one to warm up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from common import calibration, run

from turnmill_ros import conversions
from turnmill_ros.analysis import analyze
from turnmill_ros.bag import raw_messages, read_bag

BAG = Path(__file__).resolve().parent.parent / "bags" / "demo_turn_milling.mcap"


def best_of(job: Callable[[], object], runs: int = 3) -> float:
    """Least CPU time of `runs` runs [s], after one to warm up."""
    job()
    times = []
    for _ in range(runs):
        begin = time.process_time()
        job()
        times.append(time.process_time() - begin)
    return min(times)


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""

    def blocks() -> list[object]:
        return [conversions.block_from_message(m) for _, _, m in read_bag(BAG, ["sensor_blocks"])]

    raw = best_of(lambda: [len(m.data) for m in raw_messages(BAG)])
    decoded = best_of(blocks)
    count = sum(1 for _ in raw_messages(BAG))
    result = analyze(BAG)
    seconds = result.seconds(result.verdicts[-1].window_end_ns)
    analysed = best_of(lambda: analyze(BAG), 1)
    return {
        "calibration_s": calibration(),
        "messages_raw_per_s": count / raw,
        "sensor_blocks_decoded_per_s": len(blocks()) / decoded,
        "analysis_times_real_time": seconds / analysed,
        "analysis_over_reading": analysed / decoded,
    }


if __name__ == "__main__":
    run(measure, __doc__)
