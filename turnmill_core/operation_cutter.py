"""Shape of a general milling cutter: the APT tool and what is ground on it, in SI units.

The profile of the tool, from the axis outwards (Engin and Altintas 2001; thesis Figure 3.8): a tip
cone that rises by the tip angle, a corner arc, a flank that opens by the taper angle. Together with
the tool's diameter and flute length these are the seven parameters of the APT cutter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal

from .operation_checks import finite, not_negative, require

_TINY = 1e-12  # m


@dataclass(frozen=True)
class Shape:
    """What makes a cutter more than a cylinder; the default is the flat end mill.

    corner_radius [m]; corner_radial, corner_axial [m]: place of the corner's centre, from the axis
    and above the tip (None: where the arc is tangent to tip cone and flank); tip_angle [rad]: of the
    tip cone above the plane across the axis, in [0, pi/2); taper_angle [rad]: of the flank out of the
    axis, > 0 where the tool gets wider upwards.
    bottom_clearance [rad]: dish angle by which the bottom edges rise from the wiper towards the axis;
    wiper_length [m]: flat bottom edge beside the corner, without clearance.
    helix_angles [rad]: one per tooth, instead of the tool's helix angle (empty: all alike);
    helix_law: along a tapered flank the `lead` or the helix `angle` is constant. axial_runout [m]:
    how far each tooth stands out below the others (empty: none).
    """

    corner_radius: float = 0.0
    corner_radial: float | None = None
    corner_axial: float | None = None
    tip_angle: float = 0.0
    taper_angle: float = 0.0
    bottom_clearance: float = 0.0
    wiper_length: float = 0.0
    helix_angles: tuple[float, ...] = ()
    helix_law: Literal["lead", "angle"] = "lead"
    axial_runout: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        not_negative("corner radius", self.corner_radius, "m")
        for name, value in (("corner radial offset", self.corner_radial), ("corner axial offset", self.corner_axial)):
            if value is not None:
                not_negative(name, value, "m")
        require(0 <= self.tip_angle < math.pi / 2, "tip angle", self.tip_angle, "rad", "an angle in [0, pi/2)")
        require(abs(self.taper_angle) < math.pi / 2, "taper angle", self.taper_angle, "rad", "|angle| < pi/2")
        require(0 <= self.bottom_clearance < math.pi / 2, "bottom clearance", self.bottom_clearance, "rad",
                "an angle in [0, pi/2)")
        not_negative("wiper length", self.wiper_length, "m")
        require(self.bottom_clearance == 0 or self.tip_angle == 0, "bottom clearance", self.bottom_clearance, "rad",
                "0 where the tip is a cone")
        require(self.wiper_length == 0 or self.bottom_clearance > 0, "wiper length", self.wiper_length, "m",
                "0 where the whole bottom edge is flat (no bottom clearance)")
        require(all(abs(h) < math.pi / 2 for h in self.helix_angles), "helix angles", self.helix_angles, "rad",
                "|angle| < pi/2 for each tooth")
        for value in self.axial_runout:
            finite("axial runout", value, "m")

    @property
    def is_cylinder(self) -> bool:
        """True where the edges around the tool are those of a cylinder, whatever the bottom; teeth with one helix."""
        return not (self.corner_radius or self.tip_angle or self.taper_angle or self.helix_angles)


CYLINDER = Shape()


@dataclass(frozen=True)
class Outline:
    """Points of a cutter's profile (radius, height) [m], from the axis outwards and up.

    tip_end: end of the tip cone or of the flat bottom, where the corner begins; corner_end: where
    the flank begins; centre: of the corner's arc; flank_foot: radius of the flank's line at the
    height of the tip; top: end of the flank; wiper_start: radius at which the dished bottom ends.
    """

    tip_end: tuple[float, float]
    corner_end: tuple[float, float]
    centre: tuple[float, float]
    flank_foot: float
    top: tuple[float, float]
    wiper_start: float


@lru_cache(maxsize=64)
def outline(diameter: float, flute_length: float, shape: Shape) -> Outline:
    """Profile of a cutter, with the arc between cone and flank (Engin and Altintas 2001, Eq. 1-3).

    `diameter` [m] is measured where the lines of tip cone and flank meet, as in the APT definition; `flute_length` [m]
    is the tool's height, which may be infinite.

    Raises:
        ValueError: the parameters do not make a tool: the arc does not meet cone or flank, the parts
            overlap, or the tool ends before its corner.
    """
    r, tip, taper = shape.corner_radius, math.tan(shape.tip_angle), math.tan(shape.taper_angle)
    foot = diameter / 2 * (1 - tip * taper)
    require(foot > 0, "taper angle", shape.taper_angle, "rad", "a flank that leaves a tip")
    e, f = _tangent_centre(diameter, shape)
    require(e >= -1e-9 * diameter, "corner radius", r, "m", "an arc whose centre is not beyond the tool axis")
    e = max(e, 0.0) if shape.corner_radial is None else shape.corner_radial
    f = f if shape.corner_axial is None else shape.corner_axial
    if r == 0:
        given = shape.corner_radial is not None or shape.corner_axial is not None
        require(not given, "corner offsets", (shape.corner_radial, shape.corner_axial), "m",
                "none without a corner radius")
        tip_end = corner_end = (diameter / 2, diameter / 2 * tip)
        e, f = tip_end
    else:
        tip_end = _on_cone(r, e, f, tip)
        corner_end = _on_flank(r, e, f, foot, taper)
    slack = 1e-9 * diameter
    require(tip_end[0] >= -slack and tip_end[1] >= -slack and corner_end[0] > 0 and
            corner_end[1] >= tip_end[1] - slack, "corner", (r, e, f), "m",
            "a corner arc that begins on the tip cone and ends above it on the flank")
    require(flute_length > corner_end[1] - slack, "flute length", flute_length, "m",
            f"more than the height {corner_end[1]:.6g} m at which the flank begins")
    end = foot + flute_length * taper if taper else foot
    require(end > 0, "taper angle", shape.taper_angle, "rad", "a flank that does not close before the flutes end")
    wiper = tip_end[0] - shape.wiper_length if shape.bottom_clearance else 0.0
    require(wiper >= -slack, "wiper length", shape.wiper_length, "m",
            f"at most the flat bottom's radius {tip_end[0]:.6g} m")
    return Outline((max(tip_end[0], 0.0), max(tip_end[1], 0.0)), corner_end, (e, f), foot, (end, flute_length),
                   max(wiper, 0.0))


def _tangent_centre(diameter: float, shape: Shape) -> tuple[float, float]:
    """Centre of the arc that is tangent to tip cone and flank, (radius, height) [m]."""
    r, a, b = shape.corner_radius, shape.tip_angle, shape.taper_angle
    # the lines meet at (D/2, D/2 tan a); their inward normals are (-sin a, cos a) and (-cos b, sin b)
    meet = (diameter / 2, diameter / 2 * math.tan(a))
    det = math.cos(a + b)
    require(det > 1e-9, "taper angle", b, "rad", "less than 90 degrees away from the tip cone")
    along, up = r * (math.sin(b) - math.cos(a)) / det, r * (math.cos(b) - math.sin(a)) / det
    return meet[0] + along, meet[1] + up


def _on_cone(r: float, e: float, f: float, tip: float) -> tuple[float, float]:
    square = 1 + tip**2
    middle = e + f * tip
    root = middle**2 - square * (e**2 + f**2 - r**2)
    require(root > -1e-9 * r**2 * square, "corner", (r, e, f), "m", "an arc that meets the tip cone")
    radius = (middle + (math.sqrt(root) if root > 1e-9 * r**2 * square else 0.0)) / square
    return radius, radius * tip


def _on_flank(r: float, e: float, f: float, foot: float, taper: float) -> tuple[float, float]:
    square = 1 + taper**2
    middle = f - (foot - e) * taper
    root = middle**2 - square * ((foot - e) ** 2 + f**2 - r**2)
    require(root > -1e-9 * r**2 * square, "corner", (r, e, f), "m", "an arc that meets the flank")
    height = (middle - (math.sqrt(root) if root > 1e-9 * r**2 * square else 0.0)) / square
    return foot + height * taper, height


def require_bar_profile(profile: tuple[tuple[float, float], ...], length: float, radius: float) -> None:
    """Check a stock profile of (z, radius) [m] from the free end z = 0 to -length; steps are two points at one z.

    Raises:
        ValueError: fewer than two points, z that rises, ends elsewhere, a radius that is not > 0, or
            a largest radius that is not the bar's.
    """
    require(len(profile) >= 2, "stock profile", len(profile), "", "at least two points")
    z, radii = [p[0] for p in profile], [p[1] for p in profile]
    require(all(map(math.isfinite, z)) and all(b <= a for a, b in pairwise(z)), "stock profile z", z, "m",
            "values that do not rise, from the free end to the chuck")
    require(abs(z[0]) <= 1e-9 and abs(z[-1] + length) <= 1e-9, "stock profile z", (z[0], z[-1]), "m",
            f"from 0 to -{length} m, the bar's length")
    require(all(math.isfinite(r) and r > 0 for r in radii), "stock profile radius", radii, "m", "numbers > 0")
    require(abs(max(radii) - radius) <= 1e-9, "stock profile radius", max(radii), "m",
            f"a largest radius of {radius} m, that of the bar's diameter")


def check_shape(diameter: float, teeth: int, flute_length: float, shape: Shape) -> None:
    """Raise ValueError unless `shape` makes a tool of this diameter [m], number of teeth and flute length [m]."""
    for name, values in (("helix angles", shape.helix_angles), ("axial runout", shape.axial_runout)):
        require(len(values) in (0, teeth), name, values, "", f"{teeth} values, one per tooth, or none")
    outline(diameter, flute_length, shape)
