"""Vibration and surface of section 4.3.7.3: published beside computed, for each reading of the cross modes.

Source: A. Comak, Mechanics, Dynamics and Stability of Turn-Milling Operations, PhD thesis, UBC 2018. The text gives
4000 and 6 rpm with 0.4 mm per tooth, which needs 21 rpm (erratum D9), and no mode of the tool along its axis: axial
vibration can only come from the workpiece's YZ cross mode. "Round" is the engagement of the bar of 46 mm, "flat" that
of the thesis, 0 to 1.3694 rad at every depth (a bar 400 times as large at the same surface speed). Readings of the
cross modes: none, a symmetric cross receptance, a mode shape shared by both directions (rank-one). The vibration is of
the published size at 6 rpm with the flat engagement, the cusp at 21 rpm: the text mixes the two speeds.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np

from tests.published.row import Row
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_structure import CROSS_READINGS, CrossReading
from turnmill_core.process.linear import linear_map
from turnmill_core.process.linear_cut import linear_cut
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.surface import printed_extremes
from turnmill_core.process.surface_map import surface_map
from turnmill_core.process.surface_profile import circularity_error, static_cusp, surface_feed_per_tooth, surface_shift
from turnmill_core.structure.at import with_cross_reading

RPM = math.pi / 30
FLAT = 400.0
AT = "section 4.3.7.3"
DISH = math.radians(2.73)


def rows() -> list[Row]:
    """Every published number of the surface example."""
    cusps = [vibrations(reading, 21.0, True)[-1] for reading in CROSS_READINGS]
    return [*closed_forms(), *finished(), *cusps, *(row for case in CASES for row in vibrations(*case))]


@cache
def example(reading: CrossReading, speed: float, flat: bool, axial_mode: bool = False) -> Operation:
    """The case at a workpiece speed [rpm]; axial_mode: with the tool's assumed one."""
    op = read_operation(shipped_operations()["turn_milling_axial_mode"])
    workpiece = dataclasses.replace(op.workpiece, structure=with_cross_reading(op.workpiece.structure, reading))
    kept = tuple(m for m in op.tool.structure.modes if axial_mode or m.shape[2] == 0)
    tool = dataclasses.replace(op.tool, structure=dataclasses.replace(op.tool.structure, modes=kept))
    if flat:
        workpiece = dataclasses.replace(workpiece, diameter=workpiece.diameter * FLAT)
    op = dataclasses.replace(op, tool=tool, workpiece=workpiece)
    return dataclasses.replace(op, conditions=with_cut(op, workpiece_speed=speed * RPM / (FLAT if flat else 1)))


def closed_forms() -> list[Row]:
    """Polygon, cusp and shift from their formulas."""
    slow, fast = (example("none", speed, False) for speed in (6.0, 21.0))
    R = slow.conditions.effective_radius
    theta = 2 * math.pi * 6 / (4000 * 2)
    shift = surface_shift(R, 6 * RPM, 60 / 4000 / 2)
    return [
        Row("total feed per tooth, 6 rpm", AT, 0.4, surface_feed_per_tooth(slow, slow.conditions) * 1e3, "mm",
            "erratum D9: at the finished surface; 0.109 mm at the bar's own"),
        Row("total feed per tooth, 21 rpm", AT, 0.4, surface_feed_per_tooth(fast, fast.conditions) * 1e3, "mm",
            "the workpiece speed to which 0.4 mm belongs"),
        Row("circularity", AT, 0.3, circularity_error(R, 6 * RPM, 4000 * RPM, 2) * 1e6, "um",
            "Eq. 4.130; 0.3 is close to it without the half angle (next row, erratum D9)"),
        Row("circularity without the half angle", AT, 0.3, R * (1 / math.cos(theta) - 1) * 1e6, "um", "erratum D9"),
        Row("static cusp, 6 rpm", AT, 18.8, static_cusp(surface_feed_per_tooth(slow, slow.conditions), DISH) * 1e6,
            "um", "Eq. 4.131 with the feed that follows from the speeds"),
        Row("static cusp, 21 rpm", AT, 18.8, static_cusp(surface_feed_per_tooth(fast, fast.conditions), DISH) * 1e6,
            "um", "18.8 um needs a feed of 0.394 mm per tooth"),
        Row("shift of the surface in a tooth period, 6 rpm", "Eq. 4.133", "not given", shift * 1e3, "mm",
            "with the tooth period that the print lacks (erratum D10); 14.2 mm without"),
    ]


def finished() -> list[Row]:
    """The finished surface, which the thesis does not compute."""
    op = example("none", 6.0, False)
    found = surface_map(op, op.conditions, around=0.02)
    return [Row("finished surface, highest point", AT, "not given", found.undercut * 1e6, "um",
                "envelope of all tooth passes: the bar is no plane, so the pass under the tool axis is final, where "
                "the dish stands (R - |y|) tan(2.73 deg) high; leading and trailing tracks lie 4 mm apart")]


CASES = tuple((reading, speed, flat) for reading in CROSS_READINGS for speed, flat in ((6.0, False), (6.0, True)))


def vibrations(reading: CrossReading, speed: float, flat: bool) -> list[Row]:
    """Steady vibration and what of it is printed."""
    op = example(reading, speed, flat)
    steady = periodic_orbit(linear_map(linear_cut(op, op.conditions)))
    relative = steady.relative
    undercut, overcut = printed_extremes(op, op.conditions, steady.angle, relative[:, 2])
    swing = inside(op, steady.angle, relative[:, 2])
    cusp = static_cusp(surface_feed_per_tooth(op, op.conditions), DISH)
    case = f"cross modes {reading}, {speed:g} rpm, {'flat' if flat else 'round'}"
    no_axial = "no mode moves along the axis" if reading == "none" else (
        "from the YZ cross mode alone; the thesis does not say how it read it")
    peak = np.ptp(relative, axis=0) * 1e6
    figures = (
        ("normal direction y, peak to peak", 10, peak[1],
         "depends on the engagement, and on how XX and YY are read (D8)"),
        ("feed direction x, peak to peak", 15, peak[0], "depends on feed and engagement, see above"),
        ("axial direction z, peak to peak", 8, peak[2], no_axial),
        ("axial, peak to peak within the arc", 5, swing * 1e6, no_axial),
        ("axial, into the workpiece (overcut)", 3, overcut * 1e6, no_axial),
        ("cusp and vibration, largest (undercut)", 21, (cusp + undercut) * 1e6, "cusp of Eq. 4.131 and vibration"),
    )
    return [Row(f"{name}; {case}", AT, published, float(value), "um", why) for name, published, value, why in figures]


def inside(op: Operation, angle: np.ndarray, axial: np.ndarray) -> float:
    """Peak to peak [m] of the axial vibration while a tooth's tip is in the cut."""
    mean = float(axial.mean())
    up, down = printed_extremes(op, op.conditions, angle, axial - mean + 1.0)[0], printed_extremes(
        op, op.conditions, angle, axial - mean - 1.0)[1]
    return up + down - 2.0
