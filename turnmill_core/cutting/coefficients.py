"""Cutting force coefficients from orthogonal cutting data (thesis Eq. 3.47 with erratum M8)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.operation import require


@dataclass(frozen=True)
class OrthogonalData:
    """What orthogonal cutting tests of a material gave, on the normal plane of the edge.

    shear_stress [Pa]; shear_angle, friction_angle [rad].
    """

    shear_stress: float
    shear_angle: float
    friction_angle: float

    def __post_init__(self) -> None:
        require(math.isfinite(self.shear_stress) and self.shear_stress > 0, "shear stress", self.shear_stress, "Pa",
                "a finite number > 0")
        require(0 < self.shear_angle < math.pi / 2, "shear angle", self.shear_angle, "rad", "an angle in (0, pi/2)")
        require(0 <= self.friction_angle < math.pi / 2, "friction angle", self.friction_angle, "rad",
                "an angle in [0, pi/2)")


def oblique_coefficients(
    data: OrthogonalData, rake_angle: float, inclination: float, chip_flow_angle: float | None = None,
    friction_on_rake: bool = False,
) -> tuple[float, float, float]:
    """Tangential, radial and axial cutting coefficients (K_tc, K_rc, K_ac) [Pa] of an inclined edge.

    With the normal friction angle beta, normal rake alpha, shear angle phi, inclination i and chip
    flow angle eta, and D = sqrt(cos^2(phi + beta - alpha) + tan^2 eta sin^2 beta):

        K_tc = tau / sin(phi) [cos(beta - alpha) + tan i tan eta sin beta] / D
        K_rc = tau / (sin(phi) cos i) sin(beta - alpha) / D
        K_ac = tau / sin(phi) [cos(beta - alpha) tan i - tan eta sin beta] / D

    (Eq. 3.47; the printed plus in K_ac is wrong, erratum M8.) On a helical end mill the inclination
    is the helix angle.

    Args:
        data: orthogonal cutting data.
        rake_angle: normal rake angle [rad].
        inclination: inclination (oblique) angle of the edge [rad].
        chip_flow_angle: angle of chip flow on the rake face [rad]; Stabler's rule, the inclination, if not given.
        friction_on_rake: take the data's friction angle as that on the rake face, tan(beta) =
            tan(beta_a) cos(eta), instead of on the normal plane as the thesis does.

    Raises:
        ValueError: an angle at or beyond 90 degrees, or data for which the chip cannot shear.
    """
    eta = inclination if chip_flow_angle is None else chip_flow_angle
    for name, angle in (("rake angle", rake_angle), ("inclination", inclination), ("chip flow angle", eta)):
        require(abs(angle) < math.pi / 2, name, angle, "rad", "|angle| < pi/2")
    beta = data.friction_angle
    if friction_on_rake:
        beta = math.atan(math.tan(beta) * math.cos(eta))
    slope = data.shear_angle + beta - rake_angle
    require(abs(slope) < math.pi / 2, "shear angle + friction angle - rake angle", slope, "rad", "|angle| < pi/2")
    length = math.hypot(math.cos(slope), math.tan(eta) * math.sin(beta))
    scale = data.shear_stress / (math.sin(data.shear_angle) * length)
    lean = math.tan(eta) * math.sin(beta)
    along = math.cos(beta - rake_angle)
    return (
        scale * (along + math.tan(inclination) * lean),
        scale * math.sin(beta - rake_angle) / math.cos(inclination),
        scale * (along * math.tan(inclination) - lean),
    )


def orthogonal_data(
    coefficients: tuple[float, float, float], rake_angle: float, inclination: float, shear_angle: float
) -> tuple[OrthogonalData, float]:
    """Shear stress, friction and chip flow angle behind measured coefficients, the inverse of `oblique_coefficients`.

    Three coefficients determine three numbers; the shear angle must come from elsewhere (the chip
    thickness).

    Args:
        coefficients: K_tc, K_rc, K_ac [Pa].
        rake_angle: normal rake angle [rad].
        inclination: inclination of the edge [rad].
        shear_angle: normal shear angle [rad].

    Returns:
        The orthogonal data (normal-plane friction angle) and the chip flow angle [rad].

    Raises:
        ValueError: no physical data give these coefficients.
    """
    tangential, radial, axial = coefficients
    cosine, sine = math.cos(inclination), math.sin(inclination)
    # turned into the edge's axes: along the normal plane, and along the edge
    normal = tangential * cosine + axial * sine
    edge = tangential * sine - axial * cosine
    beta = rake_angle + math.atan2(radial, normal)
    require(0 < beta < math.pi / 2, "friction angle", beta, "rad",
            "an angle in (0, pi/2): check coefficients and rake angle")
    scale = normal / math.cos(beta - rake_angle)  # resultant on the normal plane, per chip area / cos(i)
    eta = math.atan2(edge, scale * math.sin(beta))
    length = math.hypot(math.cos(shear_angle + beta - rake_angle), math.tan(eta) * math.sin(beta))
    stress = scale * math.cos(inclination) * math.sin(shear_angle) * length
    return OrthogonalData(stress, shear_angle, beta), eta
