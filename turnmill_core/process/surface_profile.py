"""Surface errors of turn-milling in closed form (thesis 4.3.6.2, Eq. 4.130-4.134; Eq. 5.6)."""

from __future__ import annotations

import math

from turnmill_core.operation import Conditions, Operation, require


def circularity_error(radius: float, workpiece_speed: float, tool_speed: float, teeth: int) -> float:
    """Height [m] of a corner of the polygon above the circle inscribed, R (1 / cos(theta/2) - 1) (Eq. 4.130).

    theta = 2 pi Omega_c / (Omega_t N) is what the workpiece turns between two teeth. radius R_we [m] of the finished
    surface; workpiece_speed (any sign), tool_speed [rad/s]. Written as 2 R sin^2(theta/4) / cos(theta/2), which keeps
    every digit of a small angle. Raises ``ValueError`` where the workpiece turns half a turn or more between teeth.
    """
    require(radius > 0, "radius", radius, "m", "a number > 0")
    require(tool_speed > 0, "tool speed", tool_speed, "rad/s", "a number > 0")
    half = math.pi * abs(workpiece_speed) / (tool_speed * teeth)
    require(half < math.pi / 2, "workpiece speed", workpiece_speed, "rad/s",
            "less than half a turn from tooth to tooth")
    return 2 * radius * math.sin(half / 2) ** 2 / math.cos(half)


def static_cusp(feed_per_tooth: float, clearance: float, wiper_length: float = 0.0) -> float:
    """Largest static cusp [m], (f_t - L_wp) tan(alpha_b), 0 where the wiper is as long as the feed (Eq. 4.131).

    feed_per_tooth f_t [m], the resultant; clearance alpha_b [rad] of the bottom edges; wiper_length L_wp [m].
    """
    return cusp_at(feed_per_tooth, clearance, wiper_length)


def cusp_at(place: float, clearance: float, wiper_length: float = 0.0) -> float:
    """Height [m] of the bottom edge at `place` [m] from its tip towards the tool axis (Eq. 4.131).

    clearance alpha_b [rad] of the bottom edges; wiper_length L_wp [m].
    """
    require(place >= 0, "place", place, "m", "a number >= 0")
    require(0 <= clearance < math.pi / 2, "bottom clearance", clearance, "rad", "an angle in [0, pi/2)")
    require(wiper_length >= 0, "wiper length", wiper_length, "m", "a number >= 0")
    return max(0.0, place - wiper_length) * math.tan(clearance)


def surface_shift(radius: float, workpiece_speed: float, period: float) -> float:
    """Chord [m] by which the surface moves in `period` [s], 2 R_we sin(Omega_c T_d / 2) (Eq. 4.133, erratum D10).

    The print lacks the tooth period T_d. radius R_we [m], workpiece_speed [rad/s].
    """
    return 2 * radius * math.sin(abs(workpiece_speed) * period / 2)


def wiper_overlap(wiper_length: float, shift: float) -> float:
    """Length [m] of a tooth's flat that the next tooth passes again, L_wp - L_tp, never below 0 (Eq. 4.134, D10).

    wiper_length L_wp, shift L_tp [m].
    """
    return max(0.0, wiper_length - shift)


def surface_feed_per_tooth(op: Operation, conditions: Conditions) -> float:
    """Resultant feed per tooth [m] at the finished surface: what the tool moves over it between two teeth.

    At the radius R_w - a of the tip; the largest pitch counts where teeth are not equally spaced.
    """
    require(conditions.tool_speed > 0, "tool speed", conditions.tool_speed, "rad/s", "a number > 0")
    return conditions.resultant_feed_speed * max(op.tool.pitch) / conditions.tool_speed
