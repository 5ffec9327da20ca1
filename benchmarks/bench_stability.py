"""Speed of the stability solvers: diagrams, boundaries, live margins, and the fast solver beside the plain reference.

    python benchmarks/bench_stability.py [--json]

Medians of several runs, CPU time of one thread. The calibration loop (a fixed numpy job) tells how fast the machine is
at the moment. "textbook" is the milling benchmark with two degrees of freedom, "case_1" thesis Table 4.9 with helix,
round bar and delayed workpiece rotation.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from common import calibration, run

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.collocation import solve
from turnmill_core.stability.lobes import stability_boundary, stability_lobes
from turnmill_core.stability.margin import stability_margin
from turnmill_core.stability.operating_point import stability_problem
from turnmill_core.stability.semidiscretization import extrapolated_radius, period_map
from turnmill_core.stability.threads import one_thread

RPM = math.pi / 30
CASES = {"textbook": ("milling_benchmark_2dof", 5000, 25000, 2e-3), "case_1": ("thesis_table_4_9", 2000, 6000, 5e-3)}


def times(job: Callable[[], object], runs: int) -> list[float]:
    """CPU times of `runs` runs [s], after one to warm up."""
    job()
    found = []
    for _ in range(runs):
        begin = time.process_time()
        job()
        found.append(time.process_time() - begin)
    return found


def margins(op: Operation, count: int) -> list[float]:
    """CPU times [s] of live margins of slowly changing cuts, the search for another speed left out."""
    found = []
    for k in range(count + 1):
        cut = with_cut(op, tool_speed=op.conditions.tool_speed * (1 + 1e-3 * k), depth=1e-3 * (1 + 5e-3 * k))
        begin = time.process_time()
        stability_margin(op, cut, speed_search=False)
        found.append(time.process_time() - begin)
    return found[1:]


def reference_point(op: Operation, speed: float, depth: float, steps: int) -> float:
    """Spectral radius by the plain reference."""
    problem = stability_problem(op, with_cut(op, tool_speed=speed, depth=depth))
    with one_thread():
        return float(np.abs(np.linalg.eigvals(period_map(problem, steps).matrix)).max())


def accuracy(op: Operation, low: float, high: float, deepest: float, points: int = 12) -> tuple[float, float]:
    """Largest error of the spectral radius: of the plain reference with 40 steps a period, and of the fast solver."""
    rng = np.random.default_rng(5)
    plain, fast = 0.0, 0.0
    for _ in range(points):
        speed, depth = rng.uniform(low, high) * RPM, rng.uniform(0.1, 0.6) * deepest
        problem = stability_problem(op, with_cut(op, tool_speed=speed, depth=depth))
        truth = extrapolated_radius(problem, 400)[0]
        plain = max(plain, abs(reference_point(op, speed, depth, 40) - truth))
        fast = max(fast, abs(solve(problem).spectral_radius - truth))
    return plain, fast


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    result = {"calibration_s": calibration()}
    for name, (operation, low, high, deepest) in CASES.items():
        op = read_operation(shipped_operations()[operation])
        speeds, depths = np.linspace(low, high, 200) * RPM, np.linspace(deepest / 100, deepest, 100)
        lobes = statistics.median(times(lambda: stability_lobes(op, speeds, depths), 3))  # noqa: B023
        result[f"{name}_diagram_200x100_s"] = lobes
        result[f"{name}_boundary_200_s"] = statistics.median(
            times(lambda: stability_boundary(op, speeds, deepest), 3))  # noqa: B023
        live = margins(op, 200)
        result[f"{name}_margin_median_s"] = statistics.median(live)
        result[f"{name}_margin_p99_s"] = float(np.quantile(live, 0.99))
        point = statistics.median(times(lambda: reference_point(op, speeds[100], depths[50], 40), 20))  # noqa: B023
        result[f"{name}_reference_40_steps_point_s"] = point
        result[f"{name}_diagram_faster_than_reference_1"] = point * 20_000 / lobes
        plain, fast = accuracy(op, low, high, deepest)
        result[f"{name}_largest_error_reference_40_steps_1"] = plain
        result[f"{name}_largest_error_fast_1"] = fast
    return result


if __name__ == "__main__":
    run(measure, __doc__)
