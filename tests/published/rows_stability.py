"""Stability, delay and low speed: published beside computed, and why they differ.

Sources: A. Comak, Mechanics, Dynamics and Stability of Turn-Milling Operations, PhD thesis, UBC 2018; T. Insperger
and G. Stepan, Int. J. Numer. Meth. Engng 61 (2004) 117-141.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np

from tests.published.row import Row
from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Mode, Operation, Structure
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_stability import flank_contact_length
from turnmill_core.stability.collocation import solve
from turnmill_core.stability.delay import discrete_delay, mean_delay
from turnmill_core.stability.floquet import FloquetVerdict
from turnmill_core.stability.low_speed import low_speed_limits
from turnmill_core.stability.margin import stability_margin, stability_point
from turnmill_core.stability.problem import StabilityProblem, constant_engagement
from turnmill_core.structure.modal import modal_model, state_space
from turnmill_core.structure.rotating import rotating_structure

RPM = math.pi / 30
ROUND = "engagement of the round bar, shorter near its surface"
FLAT = "the thesis' engagement, the same at every height"


def rows() -> list[Row]:
    """Every published number of chapter 4 that this room computes."""
    found = (*textbook(), *delays(), *asymmetric_cutter(), *case_1(), *case_2(), *aisi_620(), *low_speed())
    return [row._replace(computed=float(row.computed)) for row in found]


@cache
def load(name: str) -> Operation:
    """A shipped operation."""
    return read_operation(shipped_operations()[name])


def flat(op: Operation) -> Operation:
    """The same on a bar so large that the engagement is the same at every height."""
    return dataclasses.replace(op, workpiece=dataclasses.replace(op.workpiece, diameter=20.0))


def swapped(op: Operation) -> Operation:
    """The tool's columns read the other way: XX is the cross feed, YY the feed (erratum D8)."""
    modes = tuple(dataclasses.replace(m, shape=(m.shape[1], m.shape[0], m.shape[2])) for m in op.tool.structure.modes)
    structure = Structure(modes, op.tool.structure.frame)
    return dataclasses.replace(op, tool=dataclasses.replace(op.tool, structure=structure))


def limit(op: Operation, tool_rpm: float, workpiece_rpm: float, deepest: float = 6e-3) -> float:
    """Depth limit [mm]."""
    cut = with_cut(op, tool_speed=tool_rpm * RPM, workpiece_speed=workpiece_rpm * RPM, depth=1e-4)
    return stability_margin(op, cut, deepest, speed_search=False).depth_limit * 1e3


def textbook() -> list[Row]:
    """Full immersion, 5000 rpm, one degree of freedom."""
    op, at = load("milling_benchmark_1dof"), "Insperger and Stepan 2004"
    return [
        Row(f"spectral radius at {a} mm", at, published,
            stability_point(op, with_cut(op, tool_speed=5000 * RPM, depth=a * 1e-3)).spectral_radius, "1", "its limit")
        for a, published in ((0.2, 0.81974278), (0.5, 1.07397559), (1.0, 1.40647353))
    ]


def delays() -> list[Row]:
    """Section 4.3.4."""
    pair = (math.pi, math.pi)
    angle = np.linspace(0.0, math.pi, 721)
    printed = discrete_delay(math.pi, 6000 * RPM, 3000 * RPM, 6e-3, 18e-3, 1e-3, angle)

    def ripple(diameters: float, workpiece_rpm: float) -> float:
        found = discrete_delay(math.pi / 2, 6000 * RPM, workpiece_rpm * RPM, 6e-3, diameters * 6e-3, 1e-3, angle)
        return float(np.ptp(found) / found.mean()) * 100

    slow, fast = (mean_delay(pair, 3350 * RPM, w * RPM)[0] for w in (6, 21))
    return [
        Row("delay at 6000 and 3000 rpm", "Figure 4.28", "7.48 to 7.51",
            mean_delay(pair, 6000 * RPM, 3000 * RPM)[0] * 1e3, "ms",
            "erratum D1: two teeth, not Table 4.3's four; the mean is Td (1 + 1/2)"),
        Row("largest discrete delay as printed, 6000 and 3000 rpm", "Figure 4.28", 7.51, printed.max() * 1e3, "ms",
            "Eq. 4.81-4.83 as printed, Table 4.3's diameters and depth, two teeth"),
        Row("smallest discrete delay as printed, 6000 and 3000 rpm", "Figure 4.28", 7.48, printed.min() * 1e3, "ms",
            "the same; with matching points there is no ripple (erratum D1)"),
        Row("ripple of the printed discrete delay, diameters 2, speeds 4", "section 4.3.4.2", 1.5,
            ripple(2.0, 1500), "%", "of the mean, four teeth; with matching points zero (erratum D1)"),
        Row("ripple of the printed discrete delay, diameters 8.33, speeds 2", "section 4.3.4.2", 0.2,
            ripple(8.33, 3000), "%", "the text says not more than that"),
        Row("change of the delay, 6 to 21 rpm", "section 4.3.7.3", 4.0, (fast / slow - 1) * 100, "%",
            "erratum D2: not what Eq. 4.88 gives"),
    ]


def asymmetric_problem(depth: float, rotating: bool) -> StabilityProblem:
    """Table 4.1, dominant modes, half-immersion down-milling at 16245 rpm, v radial, straight edges."""
    u, v = Mode(2283.0, 0.04375, 0.0191, (1, 0, 0)), Mode(3207.0, 0.03699, 0.0104, (0, 1, 0))
    speed = 16245 * RPM
    structure = rotating_structure(u, v, speed, "printed", "tool") if rotating else state_space(
        modal_model(Structure((u, v)), Structure()))
    return StabilityProblem(
        structure, speed, (math.pi, math.pi), (math.pi / speed,) * 2, 0.0, (732e6, 56e6, 220e6),
        constant_engagement(depth, math.pi / 2, math.pi), rotating=rotating)


@cache
def asymmetric_verdict(rotating: bool) -> FloquetVerdict:
    """Verdict at 3.0 mm."""
    return solve(asymmetric_problem(3e-3, rotating))


def asymmetric_cutter() -> list[Row]:
    """Section 4.2.3, point A of Figure 4.7."""
    at = "Figure 4.7, point A"
    lines = sorted(line.frequency for line in asymmetric_verdict(True).lines[:3])
    why = "the three strongest lines seen from the machine; Coriolis as printed, tool-fixed damping, no helix"
    return [
        *(Row(f"chatter line {q:+d}", at, published, line, "Hz", why)
          for q, published, line in zip((-1, 0, 1), (2509, 3052, 3592), lines, strict=True)),
        Row("spectral radius, rotating frame", at, "chatter", asymmetric_verdict(True).spectral_radius, "1",
            "per spindle revolution"),
        Row("spectral radius, fixed frame", at, "predicted stable", asymmetric_verdict(False).spectral_radius, "1",
            "per tooth period"),
    ]


def case_1() -> list[Row]:
    """Table 4.9: point A, chatter measured and predicted at 6 rpm and 1.2 mm, stable at 21 rpm."""
    op, at = load("thesis_table_4_9"), "Figure 4.54"
    why = "direct modes give a pocket here; no reading of axes and cross modes gives another"
    return [
        Row("depth limit, 3350 and 6 rpm", at, "below 1.2", limit(flat(op), 3350, 6), "mm",
            f"not reproduced, {FLAT}: stable up to the largest depth searched; {why}"),
        Row("depth limit, 3350 and 21 rpm", at, "above 1.4", limit(flat(op), 3350, 21), "mm", FLAT),
        *(Row(f"lobe minimum near {rpm} rpm", at, "figure only", limit(flat(swapped(op)), rpm, 6), "mm",
              f"tool's XX is the cross feed, YY the feed (erratum D8); {FLAT}") for rpm in (3100, 3550)),
        *(Row(f"lobe minimum near {rpm} rpm, as shipped", at, "figure only", limit(flat(op), rpm, 6), "mm",
              f"XX is the feed; {FLAT}") for rpm in (3100, 3550)),
        Row("lobe minimum near 3100 rpm, round bar", at, "figure only", limit(op, 3100, 6), "mm", ROUND),
    ]


def case_2() -> list[Row]:
    """Table 4.10: 0.6 mm at 3500 rpm unstable at 6 and 12 rpm, stable at 40."""
    op, at = load("thesis_table_4_10"), "Figure 4.61"
    published = {6: "below 0.6", 12: "below 0.6", 40: "above 0.6"}
    return [Row(f"depth limit, 3500 and {w} rpm{name}", at, text, limit(case, 3500, w), "mm",
                f"trend yes, level no (erratum table); {why}")
            for case, name, why in ((flat(op), "", FLAT), (op, ", round bar", ROUND)) for w, text in published.items()]


def aisi_620() -> list[Row]:
    """Table 4.11, without process damping."""
    at = "Figure 4.64"
    op = dataclasses.replace(load("thesis_table_4_11"), process_damping=None)
    point = stability_point(flat(op), with_cut(flat(op), tool_speed=2070 * RPM, workpiece_speed=6 * RPM, depth=2.2e-3))
    return [
        Row("lowest depth limit, 1500 to 3000 rpm", at, 0.3,
            min(limit(flat(op), float(rpm), 6, 4e-3) for rpm in np.linspace(1500, 3000, 16)), "mm",
            f"not reproduced, {FLAT}; cross modes left out"),
        Row("chatter frequency, 2070 rpm", at, 265, point.chatter_frequency, "Hz", "mode of the bar at 250 Hz; 2.2 mm"),
    ]


def low_speed() -> list[Row]:
    """Section 4.3.5."""
    found_here = low_speed_limits(load("thesis_table_4_11"), [600 * RPM], 8e-3)
    found, at = found_here.envelope, "section 4.3.7.3"
    assert found is not None
    return [
        Row("limit of the envelope", at, 0.15, found.depth_limit * 1e3, "mm",
            "erratum D5: the text's numbers do not return its own two tests"),
        Row("asymptotic speed of the envelope", at, 1147, found.asymptotic_speed / RPM, "rpm", "erratum D5"),
        Row("ploughing coefficient K_rp of the envelope", at, "no unit fits", found_here.ploughing, "N/m",
            "Eq. 4.119 solved for it with 264.6 Hz"),
        Row("lowest limit with process damping, 600 rpm", at, "above all",
            float(found_here.damped[0]) * 1e3, "mm", "Ksp 2.69e13 N/m3; up to 8 mm; without damping the next row"),
        Row("lowest limit without process damping, 600 rpm", at, "about 0.3", float(found_here.undamped[0]) * 1e3,
            "mm", "not reproduced: see the lowest depth limit; round bar"),
        Row("contact length of the flank", at, "0.028 m",
            flank_contact_length(60e-6, math.radians(50), math.radians(5)) * 1e6, "um",
            "erratum D6: Eq. 4.72 with 60 um, 50 and 5 degrees"),
    ]
