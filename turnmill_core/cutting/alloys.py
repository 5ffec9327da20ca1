"""Orthogonal cutting data of common alloys, and the force coefficients that follow for a tool.

Each alloy carries its source. Alloys for which no such data were found in the open literature with all of
shear stress, shear angle (or chip ratio), friction angle and edge forces are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.cutting.coefficients import OrthogonalData, oblique_coefficients
from turnmill_core.operation import Material, require

MM, MPA, M_MIN, DEG = 1e-3, 1e6, 1 / 60, math.pi / 180


@dataclass(frozen=True)
class Law:
    """A quantity that is linear in the conditions of the test: constant + chip h + speed V + rake alpha.

    Coefficients in the units of the literature: h [mm], V [m/min], alpha [deg].
    """

    constant: float
    chip: float = 0.0
    speed: float = 0.0
    rake: float = 0.0

    def __call__(self, chip_thickness: float, cutting_speed: float, rake_angle: float) -> float:
        """Value at a chip thickness [m], a cutting speed [m/s] and a rake angle [rad]."""
        return (self.constant + self.chip * chip_thickness / MM + self.speed * cutting_speed / M_MIN
                + self.rake * rake_angle / DEG)


@dataclass(frozen=True)
class Alloy:
    """What orthogonal cutting tests of an alloy gave.

    shear_stress [MPa]; friction_angle [deg]. Either shear_angle [deg], or the chip ratio as a power law
    r_c = C0 h^C1 of the chip thickness h [mm], from which the shear angle follows:
    tan(phi) = r_c cos(alpha) / (1 - r_c sin(alpha)). Kte, Kre [N/m]: edge force coefficients (Kae is 0 in
    orthogonal cutting). rake_angle, chip_thickness, cutting_speed: ranges (lowest, highest) [rad, m, m/s] in which
    the laws are used here; an end that the source does not tell is where the laws stop to make sense.
    """

    name: str
    source: str
    shear_stress: Law
    friction_angle: Law
    Kte: float
    Kre: float
    rake_angle: tuple[float, float]
    chip_thickness: tuple[float, float]
    cutting_speed: tuple[float, float]
    shear_angle: Law | None = None
    chip_ratio: tuple[Law, Law] | None = None

    def data(self, rake_angle: float, chip_thickness: float, cutting_speed: float) -> OrthogonalData:
        """Shear stress, shear angle and friction angle at a rake angle [rad], chip [m] and cutting speed [m/s].

        Raises ValueError outside the alloy's ranges.
        """
        for name, value, (low, high), unit, scale in (
            ("rake angle", rake_angle, self.rake_angle, "deg", DEG),
            ("chip thickness", chip_thickness, self.chip_thickness, "mm", MM),
            ("cutting speed", cutting_speed, self.cutting_speed, "m/min", M_MIN),
        ):
            require(low <= value <= high, f"{name} for the data of {self.name}", float(f"{value / scale:.6g}"), unit,
                    f"{low / scale:.6g} to {high / scale:.6g} {unit}")
        at = (chip_thickness, cutting_speed, rake_angle)
        if self.chip_ratio is not None:
            factor, exponent = (law(*at) for law in self.chip_ratio)
            ratio = factor * (chip_thickness / MM) ** exponent
            shear = math.atan2(ratio * math.cos(rake_angle), 1 - ratio * math.sin(rake_angle))
        else:
            assert self.shear_angle is not None
            shear = self.shear_angle(*at) * DEG
        return OrthogonalData(self.shear_stress(*at) * MPA, shear, self.friction_angle(*at) * DEG)


ALLOYS: dict[str, Alloy] = {alloy.name: alloy for alloy in (
    Alloy(
        "Ti6Al4V",
        "E. Budak, Y. Altintas, E.J.A. Armarego, Prediction of milling force coefficients from orthogonal cutting "
        "data, J. Manuf. Sci. Eng. 118 (1996) 216-224; also P. Lee, Y. Altintas, Prediction of ball-end milling forces "
        "from orthogonal cutting data, Int. J. Mach. Tools Manuf. 36 (1996) 1059-1072. Carbide tools",
        shear_stress=Law(613.0), friction_angle=Law(19.1, rake=0.29),
        chip_ratio=(Law(1.755, rake=-0.028), Law(0.331, rake=-0.0082)), Kte=24e3, Kre=43e3,
        rake_angle=(0.0, 15 * DEG), chip_thickness=(0.005 * MM, 0.2 * MM), cutting_speed=(1 * M_MIN, 100 * M_MIN),
    ),
    Alloy(
        "Al7050-T7451",
        "S.D. Merdol, Y. Altintas, Mechanics and dynamics of serrated cylindrical and tapered end mills, "
        "J. Manuf. Sci. Eng. 126 (2004) 317-326. Carbide tools",
        shear_stress=Law(297.05, rake=1.05), friction_angle=Law(18.79, chip=6.7, speed=-0.0076, rake=0.2561),
        shear_angle=Law(24.2, chip=36.67, speed=0.0049, rake=0.3), Kte=23.41e3, Kre=35.16e3,
        rake_angle=(0.0, 20 * DEG), chip_thickness=(0.005 * MM, 0.3 * MM), cutting_speed=(10 * M_MIN, 1500 * M_MIN),
    ),
)}
"""The alloys by name."""


def find_alloy(name: str) -> Alloy:
    """The alloy called `name`, blanks, hyphens and case aside. Raises ValueError, which names those there are."""
    def plain(text: str) -> str:
        return "".join(c for c in text.lower() if c.isalnum())

    found = [alloy for alloy in ALLOYS.values() if plain(alloy.name) == plain(name)]
    require(bool(found), "alloy", name, "", f"one of {', '.join(ALLOYS)}")
    return found[0]


def alloy_material(
    alloy: Alloy, rake_angle: float, inclination: float, chip_thickness: float, cutting_speed: float
) -> Material:
    """Cutting force coefficients of a tool in an alloy, by the orthogonal to oblique transformation (Eq. 3.47).

    The chip is taken to flow at the angle of the inclination (Stabler's rule).

    Args:
        alloy: orthogonal cutting data.
        rake_angle: normal rake angle of the edge [rad].
        inclination: inclination of the edge, the helix angle of an end mill [rad].
        chip_thickness: chip thickness at which the laws are taken [m].
        cutting_speed: [m/s].

    Raises:
        ValueError: outside the alloy's ranges, or an angle at or beyond 90 degrees.
    """
    data = alloy.data(rake_angle, chip_thickness, cutting_speed)
    tangential, radial, axial = oblique_coefficients(data, rake_angle, inclination)
    return Material(alloy.name, tangential, radial, axial, alloy.Kte, alloy.Kre, 0.0)
