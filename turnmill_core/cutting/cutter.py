"""Edges of a general milling cutter in elements along its profile (thesis Eq. 3.40-3.43, 3.46).

The profile is the APT tool's: bottom or tip cone, corner arc, flank (operation_cutter.py). Each piece
is divided into elements of equal length; their middles carry the local radius R(z), the axial immersion
angle kappa, the lag angle psi(z), chip width db and edge length dS. Heights of the ball are measured
from the tip, so that Eq. 3.43 reads R(z) = sqrt(R0^2 - (R0 - z)^2) (erratum M5).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from turnmill_core.cutting.tool import Array, EdgeElements, read_only, tooth_offsets
from turnmill_core.operation import Outline, Tool, outline, require

_FEWEST = 6  # elements of a piece that is not negligible


def cutter_elements(
    tool: Tool, top: float, elements: int = 64, bottom: int = 24, low: float = 0.0
) -> EdgeElements:
    """Divide the edges of `tool` from the tip, or from the height `low`, up to the height `top` [m].

    db is the element's length along the profile (db = dz / sin(kappa), Eq. 3.46, erratum M7) and
    dS = sqrt(dR^2 + dz^2 + (R dpsi)^2). The edge lags with a constant lead, psi = z tan(beta) / (D/2), all
    along the tool, or on a tapered flank with the constant helix angle if its shape says so. Bottom
    edges, which only a tool without tip cone has, are straight, radial and do not lag.

    Args:
        tool: the cutter.
        top: height [m] up to which it is divided, in (0, flute length].
        elements: about so many along tip cone, corner and flank together.
        bottom: so many along the bottom edge; 0 leaves it out.
        low: height [m] from which tip cone, corner and flank are divided, in [0, top).

    Raises:
        ValueError: heights that are not 0 <= low < top <= flute length, or a count that is too small.
    """
    require(0 <= low < top, "lowest height", low, "m", f"in [0, {top}) m, the depth")
    require(0 < top <= tool.flute_length * (1 + 1e-9), "depth", top, "m",
            f"in (0, {tool.flute_length}] m, the flute length")
    require(elements >= 1, "elements", elements, "", "an integer >= 1")
    require(bottom >= 0, "bottom elements", bottom, "", "an integer >= 0")
    line = outline(tool.diameter, tool.flute_length, tool.shape)
    below, around = _bottom(tool, line, bottom), _around(tool, line, low, top, elements)
    radius, height, sine, cosine, width, lower, upper = (
        np.concatenate(column) for column in zip(*below, *around, strict=True))
    is_bottom = np.arange(radius.size) < sum(len(piece[0]) for piece in below)
    lag, span, slope = _lags(tool, line, radius, height, lower, upper, sine)
    lag[:, is_bottom] = span[:, is_bottom] = slope[:, is_bottom] = 0.0
    return EdgeElements(
        radius=read_only(radius), height=read_only(height), sin_kappa=read_only(sine), cos_kappa=read_only(cosine),
        width=read_only(width), length=read_only(width * np.sqrt(1 + (radius * slope) ** 2)), lag=read_only(lag),
        span=read_only(span), offset=tooth_offsets(tool), runout=read_only(tool.runout or (0.0,) * tool.teeth),
        axial_runout=read_only(tool.shape.axial_runout or (0.0,) * tool.teeth), bottom=is_bottom)


_Piece = tuple[Array, ...]  # radius, height, sin and cos of kappa, width, lower and upper height of each element


def _straight(start: tuple[float, float], end: tuple[float, float], count: int) -> _Piece:
    """Elements of a straight piece of profile from `start` (radius, height) to `end`."""
    along, up = end[0] - start[0], end[1] - start[1]
    length = math.hypot(along, up)
    part = (np.arange(count) + 0.5) / count
    one = np.ones(count)
    return (start[0] + along * part, start[1] + up * part, up / length * one, along / length * one,
            length / count * one, start[1] + up * (part - 0.5 / count), start[1] + up * (part + 0.5 / count))


def _arc(tool: Tool, line: Outline, first: float, last: float, count: int) -> _Piece:
    """Elements of the corner from the axial immersion angle `first` to `last` [rad]."""
    r, (e, f) = tool.shape.corner_radius, line.centre
    edges = np.linspace(first, last, count + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    low, high = f - r * np.cos(edges[:-1]), f - r * np.cos(edges[1:])
    return (e + r * np.sin(middle), f - r * np.cos(middle), np.sin(middle), np.cos(middle), r * np.diff(edges), low,
            high)


def outer_radius(tool: Tool, height: Array) -> Array:
    """Local radius R(z) [m] of the tool at `height` [m] above the tip, same shape (Eq. 3.43)."""
    line, r, z = outline(tool.diameter, tool.flute_length, tool.shape), tool.shape.corner_radius, np.asarray(height)
    corner = line.centre[0] + np.sqrt(np.maximum(r**2 - (line.centre[1] - z) ** 2, 0.0))
    flank = line.flank_foot + z * math.tan(tool.shape.taper_angle)
    cone = z * (line.tip_end[0] / line.tip_end[1]) if line.tip_end[1] > 0 else corner
    return np.asarray(np.where(z < line.tip_end[1], cone, np.where(z < line.corner_end[1], corner, flank)))


def _bottom(tool: Tool, line: Outline, count: int) -> list[_Piece]:
    """Flat or dished bottom edge, from the axis outwards."""
    if count == 0 or tool.shape.tip_angle > 0 or line.tip_end[0] <= 1e-9 * tool.diameter:
        return []
    rim, wiper = line.tip_end[0], line.wiper_start
    if tool.shape.bottom_clearance == 0 or wiper == 0:
        return [_straight((0.0, 0.0), (rim, 0.0), count)]
    dish = max(1, round(count * wiper / rim))
    pieces = [_straight((0.0, wiper * math.tan(tool.shape.bottom_clearance)), (wiper, 0.0), dish)]
    if rim > wiper:
        pieces.append(_straight((wiper, 0.0), (rim, 0.0), max(2, count - dish)))
    return pieces


def _around(tool: Tool, line: Outline, low: float, top: float, count: int) -> list[_Piece]:
    """Tip cone, corner and flank from `low` to `top`, each with its share of `count` elements."""
    r, f, tip_height, corner_height = tool.shape.corner_radius, line.centre[1], line.tip_end[1], line.corner_end[1]
    cone, taper = math.tan(tool.shape.tip_angle), math.tan(tool.shape.taper_angle)
    makers: list[Callable[[int], _Piece]] = []
    lengths = []

    def straight(start: tuple[float, float], end: tuple[float, float]) -> None:
        makers.append(lambda n: _straight(start, end, n))
        lengths.append(math.dist(start, end))

    if low < tip_height:
        end = min(top, tip_height)
        straight((low / cone, low), (end / cone, end))
    if r > 0 and top > tip_height and low < corner_height:
        first, last = (math.acos(max(-1.0, min(1.0, (f - z) / r)))
                       for z in (max(low, tip_height), min(top, corner_height)))
        makers.append(lambda n: _arc(tool, line, first, last, n))
        lengths.append(r * (last - first))
    if top > corner_height:
        start = max(low, corner_height)
        straight((line.flank_foot + start * taper, start), (line.flank_foot + top * taper, top))
    total = sum(lengths)
    fewest = min(_FEWEST, count) if len(makers) > 1 else count
    return [make(max(fewest, round(count * length / total))) for make, length in zip(makers, lengths, strict=True)]


def _lags(
    tool: Tool, line: Outline, radius: Array, height: Array, low: Array, high: Array, sine: Array
) -> tuple[Array, Array, Array]:
    """Lag at the middle, from lower to upper end, and its slope along the profile [rad, rad, rad/m], each (N, m)."""
    tangent = np.tan(np.array(tool.shape.helix_angles or (tool.helix_angle,) * tool.teeth))[:, None]
    taper = tool.shape.taper_angle
    foot, start = line.corner_end

    def lag(z: Array) -> Array:
        lead = z / tool.radius
        if tool.shape.helix_law == "lead" or taper == 0:
            return lead
        flank = np.maximum(z, start)
        on_flank = np.log((line.flank_foot + flank * math.tan(taper)) / foot) / math.sin(taper)
        return np.asarray(np.where(z > start, start / tool.radius + on_flank, lead), dtype=np.float64)

    slope = sine / tool.radius * np.ones_like(height)
    if tool.shape.helix_law == "angle" and taper != 0:
        slope = np.where(height > start, 1 / radius, slope)
    return tangent * lag(height), tangent * (lag(high) - lag(low)), tangent * slope
