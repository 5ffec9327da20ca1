"""Speed of the parameter selection: the thesis' case of chapter 5, five workpiece speeds, all limits.

    python benchmarks/bench_plan.py [--json]

plan_*: 200 tool speeds, 100 depths and 5 workpiece speeds; robust_*: the same with 40 draws and the choice among them;
suggestion_*: the coarser search that answers the running graph. Times of one process, wall and CPU, after one small
plan to warm up.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from common import calibration, run

from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.plan import default_grid, plan
from turnmill_core.process.robust import draw, robust_choice
from turnmill_core.process.suggestion import suggest

RPM = math.pi / 30
T = TypeVar("T")


def timed(result: dict[str, float], name: str, job: Callable[[], T]) -> T:
    """Run a job and note its wall and CPU time [s]."""
    wall, cpu = time.perf_counter(), time.process_time()
    value = job()
    result[f"{name}_wall_s"], result[f"{name}_cpu_s"] = time.perf_counter() - wall, time.process_time() - cpu
    return value


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    op, result = read_operation(shipped_operations()["thesis_table_5_1"]), {}
    five = tuple(w * RPM for w in (10, 20, 30, 40, 50))
    plan(op, replace(default_grid(op, 8, 8), workpiece_speeds=five[:1]))
    result["calibration_s"] = calibration()
    made = timed(result, "plan", lambda: plan(op, replace(default_grid(op, 200, 100), workpiece_speeds=five)))
    draws = timed(result, "draws_40", lambda: draw(op, 40))
    robust = timed(result, "robust", lambda: robust_choice(made, draws, 0.9))
    timed(result, "suggestion", lambda: suggest(op))
    assert made.best is not None
    assert robust is not None
    result["plan_cells"] = sum(r.least.size for r in made.regions)
    result["robust_over_best_rate_1"] = robust.rate / made.best.rate
    return result


if __name__ == "__main__":
    run(measure, __doc__)
