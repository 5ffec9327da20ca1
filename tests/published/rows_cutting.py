"""Chips, engagement, forces, chip-load limits and removal rates: published beside computed.

Source: A. Comak, Mechanics, Dynamics and Stability of Turn-Milling Operations, PhD thesis, UBC 2018.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from tests.published.row import Row
from turnmill_core.cutting.alloys import alloy_material, find_alloy
from turnmill_core.cutting.bottom import bottom_loads
from turnmill_core.cutting.chip import (
    exact_chip,
    feed_per_tooth,
    prepare_cut,
    tool_speed_for_cutting_speed,
    tool_speed_for_feed_per_tooth,
)
from turnmill_core.cutting.coefficients import orthogonal_data
from turnmill_core.cutting.engagement import cutting_time_share, engagement, removal
from turnmill_core.cutting.feed import feed_angle, to_feed_frame
from turnmill_core.cutting.forces import Revolution, revolution
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations

RPM = 2 * math.pi / 60
ANGLES, ELEMENTS = 1440, 200


def rows() -> list[Row]:
    """Every number of thesis chapter 3, sections 4.2 and 5 that this room computes."""
    found = (*table_31(), *table_32(), *section_42(), *chapter_5())
    return [row._replace(computed=float(row.computed)) for row in found]


def load(name: str, helix_deg: float | None = None) -> Operation:
    """A shipped operation, with another helix angle if one is given."""
    op = read_operation(shipped_operations()[name])
    if helix_deg is None:
        return op
    return dataclasses.replace(op, tool=dataclasses.replace(op.tool, helix_angle=math.radians(helix_deg)))


def _turn(op: Operation, chip: str = "static") -> Revolution:
    return revolution(op, op.conditions, ANGLES, ELEMENTS, chip)  # type: ignore[arg-type]


def _resultant_frame(op: Operation, turn: Revolution) -> np.ndarray:
    return to_feed_frame(turn.force_tool, float(feed_angle(op, op.conditions, np.zeros(1))[0]))


def table_31() -> list[Row]:
    """Table 3.1: Al6061-T6 bar, 16 mm tool."""
    op, straight = load("thesis_table_3_1"), load("thesis_table_3_1", 0.0)
    turn, exact = _turn(op), _turn(op, "exact")
    force = _resultant_frame(op, turn)
    at = "Table 3.1"
    figure = "the figure is not available as numbers; Eq. 3.44 chip, x along the resultant feed (Eq. 3.32)"
    tool_frame = "same forces, x_T on the machine's axis: turned by the feed angle of 0.35 deg"
    ratio = "no definition tried gives 0.1963"
    share, share_straight = (cutting_time_share(o, o.conditions) for o in (op, straight))
    m = op.material
    _, flow = orthogonal_data((m.Ktc, m.Krc, m.Kac), math.radians(5), math.radians(25), math.radians(30))
    bottom = bottom_loads(op, op.conditions, ANGLES)
    result = [
        Row("chip flow angle behind K_tc, K_rc, K_ac", at, 25, math.degrees(flow), "deg",
            "the printed coefficients, 5 deg rake and 25 deg helix return Stabler's rule (flow = helix) only with the "
            "minus of erratum M8 in Eq. 3.47"),
        Row("Fz mean, side edges", at, "figure only", force[:, 2].mean(), "N",
            "the thesis' model; it names the missing bottom and axial runout as the cause of its 35 % error"),
        Row("Fz mean, side and bottom edges", at, "figure only", force[:, 2].mean() + bottom.force_tool[:, 2].mean(),
            "N", "bottom edges with the side's coefficients, for a flat end: a dish angle makes it less"),
        Row("largest chip", at, "figure only", turn.chip_thickness_max * 1e3, "mm", "Eq. 3.44 (erratum M6)"),
        Row("largest chip, exact", at, "figure only", exact.chip_thickness_max * 1e3, "mm",
            "trochoid and previous revolution's wall"),
        Row("Fx smallest", at, "figure only", force[:, 0].min(), "N", figure),
        Row("Fx largest", at, "figure only", force[:, 0].max(), "N", figure),
        Row("Fx mean", at, "figure only", force[:, 0].mean(), "N", figure),
        Row("Fy smallest", at, "figure only", force[:, 1].min(), "N", figure),
        Row("Fy largest", at, "figure only", force[:, 1].max(), "N", figure),
        Row("Fy largest, tool frame", at, "figure only", turn.force_tool[:, 1].max(), "N", tool_frame),
        Row("Fz smallest", at, "figure only", force[:, 2].min(), "N", figure + "; side edges only"),
        Row("tool torque, peak", at, "figure only", turn.tool_torque.max(), "N m", "Eq. 3.52"),
        Row("volume through the tool's bottom", at, "not given", 100 * removal(op, op.conditions).bottom_share, "%",
            "side and bottom together equal the total to 0.1 %"),
        Row("cutting / non-cutting time", at, 0.1963, share / (1 - share), "1", ratio),
        Row("cutting / total time", at, 0.1963, share, "1", ratio),
        Row("cutting / non-cutting time, no helix", at, 0.1963, share_straight / (1 - share_straight), "1", ratio),
        Row("cutting / total time, no helix", at, 0.1963, share_straight, "1", ratio),
    ]
    for height in (0.0, 0.73, 0.8, 0.9, 1.0):
        arc = engagement(op, op.conditions, np.array([height * 1e-3]))
        result.append(Row(f"exit angle at {height:g} mm", at, "figure only", math.degrees(arc.exit[0, 0]), "deg",
                          "varies with height, as the text says; the cut starts at -0.35 deg, the feed angle"))
    return result


def table_32() -> list[Row]:
    """Table 3.2: AISI 1040 bar, 10 mm tool; the thesis gives no helix angle."""
    straight = load("thesis_table_3_2", 0.0)
    at = "Table 3.2"
    share = cutting_time_share(straight, straight.conditions)
    turned = load("thesis_table_3_2", 13.7)
    share_turned = cutting_time_share(turned, turned.conditions)
    static, exact = _turn(straight), _turn(straight, "exact")
    cut = prepare_cut(straight, straight.conditions, 1)
    assert cut.bar is not None
    cut = dataclasses.replace(cut, bar=dataclasses.replace(cut.bar, walls=(-math.inf, math.inf)))
    arc = np.linspace(cut.engagement.start[0, 0], cut.engagement.exit[0, 0], 200)
    trochoid = exact_chip(cut, arc[:, None, None] * np.ones((1, straight.tool.teeth, 1))).max()
    chip = "0.27 is not reached by the sine, the trochoid or the chip with the previous revolution's wall"
    result = [
        Row("largest chip", at, 0.27, static.chip_thickness_max * 1e3, "mm", f"Eq. 3.44: {chip}"),
        Row("largest chip, trochoid alone", at, 0.27, float(trochoid) * 1e3, "mm", chip),
        Row("largest chip, exact", at, 0.27, exact.chip_thickness_max * 1e3, "mm", chip),
        Row("cutting / non-cutting time, no helix", at, 0.311, share / (1 - share), "1", "the helix is not given"),
        Row("cutting / non-cutting time, 13.7 deg helix", at, 0.311, share_turned / (1 - share_turned), "1",
            "the helix that gives the printed ratio; chosen for it, so no evidence"),
    ]
    for helix in (0.0, 30.0):
        op = load("thesis_table_3_2", helix)
        for name, model in (("", "static"), (", exact chip", "exact")):
            peak = float(np.hypot(*_turn(op, model).force_tool[:, :2].T).max())
            why = "the helix is not given; 30 deg gives 197 N with Eq. 3.44 and 156 N with the exact chip"
            result.append(Row(f"resultant force, peak, {helix:g} deg helix{name}", at, "figure only", peak, "N", why))
    return result


def section_42() -> list[Row]:
    """Al7050-T7451: coefficients from orthogonal data beside those identified on a milling tool."""
    found = alloy_material(find_alloy("Al7050-T7451"), math.radians(13.5), math.radians(25), 0.05e-3, 200 / 60)
    why = ("identified by average forces in the thesis; computed from orthogonal tests of other bars (Merdol, Altintas "
           "2004), rake 13.5 deg, helix 25 deg, chip 0.05 mm and 200 m/min assumed")
    values = ((732, found.Ktc, "MPa"), (56, found.Krc, "MPa"), (220, found.Kac, "MPa"), (21.96, found.Kte, "N/mm"),
              (23.21, found.Kre, "N/mm"), (22, found.Kae, "N/mm"))
    scale = {"MPa": 1e-6, "N/mm": 1e-3}
    return [Row(f"Al7050-T7451 {name}", "section 4.2.3", published, value * scale[unit], unit, why)
            for name, (published, value, unit) in zip(("K_tc", "K_rc", "K_ac", "K_te", "K_re", "K_ae"), values,
                                                      strict=True)]


def chapter_5() -> list[Row]:
    """Chip-load limit, cutting-speed limit and removal rate of the parameter selection case."""
    op = load("thesis_table_5_1")
    limit = "hypot(pi D_w Omega_c, f_a Omega_c) / (N 0.4 mm): feed per tooth on the bar's surface"
    printed = {10: (1960, 5.5, 61512), 20: (3932, 2.8, 66431), 30: (5898, 1.85, 67163), 40: (7864, 1.5, 73136),
               50: (9830, 1.25, 76576)}
    result = [Row("cutting-speed limit of the tool, 650 m/min", "section 5.3, Table 5.2", 10345,
                  tool_speed_for_cutting_speed(op, 650 / 60) / RPM, "rpm", "agrees")]
    for workpiece_rpm, (tool_rpm, depth_mm, rate) in printed.items():
        conditions = with_cut(op, workpiece_speed=workpiece_rpm * RPM, depth=depth_mm * 1e-3)
        speed = tool_speed_for_feed_per_tooth(op, conditions, 0.4e-3)
        at_limit = dataclasses.replace(conditions, tool_speed=speed)
        assert math.isclose(feed_per_tooth(op, at_limit), 0.4e-3)
        result += [
            Row(f"chip-load limit of the tool speed, workpiece {workpiece_rpm} rpm", "Table 5.2", tool_rpm, speed / RPM,
                "rpm", limit + ("; 1960 is a slip" if tool_rpm == 1960 else "")),
            Row(f"removal rate, workpiece {workpiece_rpm} rpm, {depth_mm:g} mm", "Table 5.2", rate,
                removal(op, conditions).total * 60e9, "mm3/min", "Eq. 5.1 with its lost factor a"),
        ]
    return result
