"""Parameter selection of chapter 5: published beside computed, and why they differ.

The chart of the tool spindle (Figure 5.4) is missing. Assumption, named in the operation file: 4 kW largest power at
every speed, which is what the first row's 5.5 mm needs with the thesis' engagement, the same at every depth; the
other rows and all intervals were not used. "Flat" stands for that engagement (a bar 400 times as large at the same
surface speed), "round" for the bar of 50 mm, whose engagement grows from nothing at its surface.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np

from tests.published.row import Row
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.plan import Plan, default_grid, plan

RPM = math.pi / 30
FLAT = 400.0
TABLE_5_2 = {10: (1960, 10345, 5.5, 61512), 20: (3932, 10345, 2.8, 66431), 30: (5898, 10345, 1.85, 67163),
             40: (7864, 10345, 1.5, 73136), 50: (9830, 10345, 1.25, 76576)}
EQ_5_8 = {10: ((2370, 2570), (3350, 3900), (5800, 8050)), 20: ((5400, 8700),), 30: ((5898, 9500),),
          40: ((7864, 10345),), 50: ((10000, 10345),)}


@cache
def case() -> Operation:
    """The thesis' case."""
    return read_operation(shipped_operations()["thesis_table_5_1"])


def flat(op: Operation) -> Operation:
    """The same surface speed on a bar so large that the engagement is the same at every depth."""
    limits = dataclasses.replace(op.limits, workpiece_speed_max=op.limits.workpiece_speed_max / FLAT)
    bar = dataclasses.replace(op.workpiece, diameter=op.workpiece.diameter * FLAT)
    return dataclasses.replace(op, workpiece=bar, limits=limits)


@cache
def planned(name: str) -> Plan:
    """The plan at the five workpiece speeds and 60 rpm: "flat" or "round"."""
    op, scale = (flat(case()), FLAT) if name == "flat" else (case(), 1.0)
    grid = default_grid(case(), *((80, 48) if name == "flat" else (24, 48)))
    return plan(op, dataclasses.replace(grid, workpiece_speeds=tuple(w * RPM / scale for w in (*TABLE_5_2, 60))))


def rows() -> list[Row]:
    """Table 5.2, Eq. 5.7 and 5.8, and why there is no cut at 60 rpm."""
    found = [*speeds_and_rates(), *depths(), *powers(), *intervals(), *sixty()]
    return [row._replace(computed=float(row.computed)) for row in found]


def speeds_and_rates() -> list[Row]:
    """The columns of Table 5.2 that are reproduced."""
    found = []
    for region, (turning, (low, high, depth, rate)) in zip(planned("round").regions, TABLE_5_2.items(), strict=False):
        usable = region.tool_speeds[region.feasible.any(axis=0)] / RPM
        slip = "1966; the print's 1960 is a slip" if turning == 10 else "largest chip load, 0.4 mm"
        cut = with_cut(case(), workpiece_speed=turning * RPM, depth=depth * 1e-3)
        found += [
            Row(f"least tool speed, {turning} rpm", "Table 5.2", low, usable[0], "rpm", slip),
            Row(f"largest tool speed, {turning} rpm", "Table 5.2", high, usable[-1], "rpm", "650 m/min"),
            Row(f"removal rate at {depth} mm, {turning} rpm", "Table 5.2", rate,
                cutting_loads(case(), cut).material_removal_rate * 6e10, "mm3/min", "Eq. 5.1 with its lost factor a"),
        ]
    return found


def depths() -> list[Row]:
    """Largest feasible depths."""
    found = []
    for name, why in (("flat", "4 kW assumed; only the first row was used"),
                      ("round", "4 kW assumed; the round bar needs less power at the same depth")):
        for region, (turning, (*_, depth, _)) in zip(planned(name).regions, TABLE_5_2.items(), strict=False):
            text = f"{depth} (Eq. 5.7: 2.7)" if turning == 20 else depth
            found.append(Row(f"largest depth, {turning} rpm, {name}", "Table 5.2", text,
                             region.depth_limit.max() * 1e3, "mm", why))
    return found


def powers() -> list[Row]:
    """Largest power of the tool spindle that each published depth stands for."""
    found = []
    for turning, (*_, depth, _) in TABLE_5_2.items():
        cut = with_cut(flat(case()), workpiece_speed=turning * RPM / FLAT, depth=depth * 1e-3)
        power = cutting_loads(flat(case()), cut).tool_torque_peak * cut.tool_speed
        found.append(Row(f"largest power at {depth} mm, {turning} rpm", "Figure 5.4", "figure missing", power / 1e3,
                         "kW", "flat; no single value fits all rows"))
    return found


def intervals() -> list[Row]:
    """Tool speeds that allow the largest depth: of the computed intervals those that meet the published ones."""
    found = []
    for region, (turning, published) in zip(planned("flat").regions, EQ_5_8.items(), strict=False):
        limit = region.depth_limit
        computed = region.speed_intervals(0.99 * float(limit.max()))
        for number, (low, high) in enumerate(published):
            own = next((c for c in computed if c[0] < high * RPM and c[1] > low * RPM), (math.nan, math.nan))
            why = "lobes and 4 kW, flat; within 1 % of the largest depth" if turning == 10 else (
                "constant power limits the depth alike at every speed; the missing chart's shape narrows it")
            found += [Row(f"interval {number + 1}, {turning} rpm, from", "Eq. 5.8", low, own[0] / RPM, "rpm", why),
                      Row(f"interval {number + 1}, {turning} rpm, to", "Eq. 5.8", high, own[1] / RPM, "rpm", why)]
    return found


def sixty() -> list[Row]:
    """Why there is no cut at 60 rpm."""
    conflict = planned("round").reasons[len(TABLE_5_2)][0]
    names = " and ".join(conflict.limits)
    return [
        Row("chip load asks for, 60 rpm", "section 5.3", "no feasible region", conflict.asks / RPM, "rpm",
            f"{names} exclude each other"),
        Row("cutting speed allows, 60 rpm", "section 5.3", "no feasible region", conflict.allows / RPM, "rpm",
            f"{names} exclude each other"),
        Row("feasible cuts at 60 rpm", "section 5.3", 0, float(np.count_nonzero(planned("round").regions[-1].feasible)),
            "1", "of the whole grid"),
    ]
