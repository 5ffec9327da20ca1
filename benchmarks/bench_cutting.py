"""Speed of the cutting model: one revolution, compiled beside numpy, the loads of a node, engagement along a path.

    python benchmarks/bench_cutting.py [--json]

Best of several runs. The calibration loop (a fixed numpy job) tells how fast the machine is at the moment.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

from common import calibration, run

from turnmill_core.cutting.chip import prepare_cut
from turnmill_core.cutting.engagement_map import engagement_along
from turnmill_core.cutting.forces import revolve
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.kinematics import NT3150
from turnmill_core.machine.path_motion import axis_states, path_motion
from turnmill_core.machine.turn_milling_paths import cut_from_operation, orthogonal_path
from turnmill_core.operation import Conditions, Material, Operation, Shape, Tool, Workpiece
from turnmill_core.operation_file import read_operation, shipped_operations


def best_of(job: Callable[[], object], runs: int) -> float:
    """Shortest time of `runs` runs [s], after one to warm up."""
    job()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        job()
        times.append(time.perf_counter() - begin)
    return min(times)


def slot() -> Operation:
    """Full slot with 4 teeth and 30 degrees of helix: every second element is in the cut, the worst case."""
    tool = Tool("end mill", 0.02, 4, math.radians(30))
    conditions = Conditions(3000 * 2 * math.pi / 60, 0.0, 0.005, 0.02, (-0.01, 0.01))
    material = Material("aluminium", 930e6, 290e6, 242e6, 21e3, 25e3, 8e3)
    block = Workpiece("block", length=0.2, width=0.1, height=0.05)
    return Operation("slot", "milling", "none", tool, block, material, conditions, "slot", feed_per_tooth=1e-4)


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    result = {"calibration_s": calibration()}
    cases = {"slot": slot(), "turn_milling": read_operation(shipped_operations()["thesis_table_3_2"])}
    for name, op in cases.items():
        cut = prepare_cut(op, op.conditions, 100)
        for chip in ("static", "exact"):
            fast = best_of(lambda: revolve(op, cut, 360, chip, "fast"), 30)  # noqa: B023
            plain = best_of(lambda: revolve(op, cut, 360, chip, "plain"), 3)  # noqa: B023
            result[f"{name}_{chip}_360x100_s"] = fast
            result[f"{name}_{chip}_plain_over_fast"] = plain / fast
        begin, count = time.process_time(), 100
        for _ in range(count):
            cutting_loads(op, op.conditions)
        result[f"{name}_loads_cpu_s"] = (time.process_time() - begin) / count
        result[f"{name}_loads_cpu_share_at_50_hz"] = 50 * result[f"{name}_loads_cpu_s"]
    return {**result, **numeric_engagement()}


def numeric_engagement(points: int = 1000) -> dict[str, float]:
    """Wall and CPU time of that many maps along a turn-milling path, the workpiece updated in between [s]."""
    result = {}
    shapes = {"cylinder": Shape(), "ball": Shape(corner_radius=8e-3), "bull_nose": Shape(corner_radius=3e-3)}
    for name, shape in shapes.items():
        table = read_operation(shipped_operations()["thesis_table_3_1"])
        op = replace(table, tool=replace(table.tool, flute_length=0.03, shape=shape),
                     conditions=replace(table.conditions, workpiece_speed=10 * table.conditions.workpiece_speed))
        path = orthogonal_path(cut_from_operation(op))
        states = axis_states(path_motion(NT3150, path), path, 50.0)[:points]
        for _ in engagement_along(op, states[points // 2:points // 2 + 3]):  # compiles
            pass
        begin, cpu = time.perf_counter(), time.process_time()
        cuts = list(engagement_along(op, states))
        result[f"engagement_{name}_{points}_points_s"] = time.perf_counter() - begin
        result[f"engagement_{name}_{points}_points_cpu_s"] = time.process_time() - cpu
        rates = sorted(c.removal.total for c in cuts)
        result[f"engagement_{name}_removal_mm3_s"] = rates[len(rates) // 2] * 1e9
    return result


if __name__ == "__main__":
    run(measure, __doc__)
