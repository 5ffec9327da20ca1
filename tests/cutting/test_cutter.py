"""General cutter: profile, axial immersion angle, chip width, edge length, lag; tools that cannot exist."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from turnmill_core.cutting.cutter import cutter_elements, outer_radius
from turnmill_core.cutting.tool import edge_elements, predecessors
from turnmill_core.operation import CYLINDER, Shape, Tool, outline

R, MM, DEG = 8e-3, 1e-3, math.pi / 180
BALL = Shape(corner_radius=R)
BULL = Shape(corner_radius=3 * MM)
TAPER = Shape(corner_radius=2 * MM, taper_angle=8 * DEG)
CONE = Shape(corner_radius=1 * MM, tip_angle=20 * DEG, taper_angle=5 * DEG)
DISH = Shape(corner_radius=1 * MM, bottom_clearance=3 * DEG, wiper_length=1.5 * MM)
LOLLIPOP = Shape(corner_radius=6 * MM, corner_radial=2 * MM, corner_axial=5.9 * MM)
SHAPES = (Shape(), BALL, BULL, TAPER, CONE, DISH, LOLLIPOP)


def tool(shape: Shape = CYLINDER, **other: Any) -> Tool:
    return Tool("t", 2 * R, 2, 25 * DEG, 30 * MM, shape=shape, **other)


def test_the_cylinder_is_that_of_the_closed_form() -> None:
    plain, general = edge_elements(tool(), 5 * MM, 20), cutter_elements(tool(), 5 * MM, 20, bottom=0)
    for name in ("radius", "height", "sin_kappa", "cos_kappa", "width", "length", "lag", "span", "offset"):
        assert getattr(general, name) == pytest.approx(getattr(plain, name), rel=1e-14, abs=1e-18), name


def test_ball_has_its_sphere_whatever_the_height() -> None:
    """Eq. 3.43 with erratum M5: z from the centre; kappa is the angle at the centre."""
    edges = cutter_elements(tool(BALL), R, 30)
    from_centre = R - edges.height
    assert edges.radius == pytest.approx(np.sqrt(R**2 - from_centre**2), rel=1e-12)
    assert edges.kappa == pytest.approx(np.arcsin(edges.radius / R), rel=1e-9)
    assert edges.width.sum() == pytest.approx(math.pi / 2 * R, rel=1e-12)
    assert not edges.bottom.any()


@pytest.mark.parametrize("shape", SHAPES)
def test_elements_lie_on_the_profile_with_its_normal(shape: Shape) -> None:
    """Radius, height, normal, width and edge length against the curve itself, drawn finely."""
    cutter, top = tool(shape), 12 * MM
    edges = cutter_elements(cutter, top, 400, bottom=100)
    around = ~edges.bottom
    assert edges.radius[around] == pytest.approx(outer_radius(cutter, edges.height[around]), rel=1e-9)
    z = np.linspace(0.0, top, 400_001)
    r = outer_radius(cutter, z)
    begin = outline(2 * R, 30 * MM, shape).tip_end[0] if shape.tip_angle == 0 else 0.0
    length = np.hypot(np.diff(r), np.diff(z)).sum() + abs(r[0] - begin)
    assert edges.width[around].sum() == pytest.approx(length, rel=2e-5)
    lag = z * math.tan(25 * DEG) / R
    curve = np.stack([r * np.cos(lag), r * np.sin(lag), z])
    drawn = np.linalg.norm(np.diff(curve, axis=1), axis=0).sum() + abs(r[0] - begin)
    assert edges.length[0][around].sum() == pytest.approx(drawn, rel=2e-4)
    # the normal is across the profile
    step = 1e-7
    inner = (edges.height > 2 * step) & around & (edges.sin_kappa > 0.05)
    slope = (outer_radius(cutter, edges.height + step) - outer_radius(cutter, edges.height - step)) / (2 * step)
    assert edges.cos_kappa[inner] / edges.sin_kappa[inner] == pytest.approx(slope[inner], rel=2e-3, abs=2e-3)


def test_corner_is_tangent_to_tip_and_flank_where_its_centre_is_not_given() -> None:
    for shape in (BALL, BULL, TAPER, CONE):
        line = outline(2 * R, 30 * MM, shape)
        arc = np.array(line.tip_end) - line.centre, np.array(line.corner_end) - line.centre
        a, b = shape.tip_angle, shape.taper_angle
        assert arc[0] == pytest.approx(shape.corner_radius * np.array([math.sin(a), -math.cos(a)]), abs=1e-9)
        assert arc[1] == pytest.approx(shape.corner_radius * np.array([math.cos(b), -math.sin(b)]), abs=1e-9)
        assert math.dist(arc[0], (0, 0)) == pytest.approx(shape.corner_radius)


def test_dish_rises_to_the_axis_and_the_wiper_is_flat() -> None:
    edges = cutter_elements(tool(DISH), 5 * MM, 40, bottom=40)
    bottom, r = edges.bottom, edges.radius
    wiper = bottom & (r > 5.5 * MM)
    assert edges.height[wiper] == pytest.approx(0.0)
    assert edges.kappa[wiper] == pytest.approx(0.0)
    dish = bottom & ~wiper
    assert edges.height[dish] == pytest.approx((5.5 * MM - r[dish]) * math.tan(3 * DEG))
    assert edges.kappa[dish] == pytest.approx(-3 * DEG)
    assert edges.width[bottom].sum() == pytest.approx(1.5 * MM + 5.5 * MM / math.cos(3 * DEG))
    assert np.all(edges.lag[:, bottom] == 0)


def test_constant_helix_angle_on_a_tapered_flank() -> None:
    """tan(beta) = R dpsi / dl everywhere on the flank; with a constant lead it changes with the radius."""
    shape = Shape(taper_angle=10 * DEG, helix_law="angle")
    edges = cutter_elements(tool(shape), 20 * MM, 200, bottom=0)
    assert edges.length[0] == pytest.approx(edges.width / math.cos(25 * DEG))
    helix = edges.radius * np.gradient(edges.lag[0]) / edges.width
    assert helix[1:-1] == pytest.approx(math.tan(25 * DEG), rel=1e-4)
    lead = cutter_elements(tool(Shape(taper_angle=10 * DEG)), 20 * MM, 200, bottom=0)
    assert lead.lag[0] == pytest.approx(lead.height * math.tan(25 * DEG) / R)


def test_variable_helix_changes_the_pitch_along_the_edge() -> None:
    cutter = tool(Shape(helix_angles=(25 * DEG, 30 * DEG)))
    edges = cutter_elements(cutter, 10 * MM, 10, bottom=0)
    angle, _ = predecessors(cutter, edges)
    more = edges.height * (math.tan(30 * DEG) - math.tan(25 * DEG)) / R
    assert angle[:, 0, 0] == pytest.approx(math.pi - more)
    assert angle[:, 1, 0] == pytest.approx(math.pi + more)
    with pytest.raises(ValueError, match=r"helix angles is .* expected angles with which the teeth do not meet"):
        predecessors(tool(Shape(helix_angles=(0.0, 60 * DEG))), cutter_elements(
            tool(Shape(helix_angles=(0.0, 60 * DEG))), 20 * MM, 10, bottom=0))


def test_runout_steps_along_the_normal() -> None:
    """Radial runout counts on the flank, axial runout on the bottom, both in between on a ball."""
    cutter = tool(Shape(corner_radius=R, axial_runout=(20e-6, 0.0)), runout=(10e-6, 0.0))
    edges = cutter_elements(cutter, R, 9)
    _, step = predecessors(cutter, edges)
    assert step[:, 0, 0] == pytest.approx(10e-6 * edges.sin_kappa + 20e-6 * edges.cos_kappa)
    assert step[:, 1, 0] == pytest.approx(-step[:, 0, 0])


@pytest.mark.parametrize(("shape", "message"), [
    ({"corner_radius": 9 * MM}, r"corner radius is 0\.009\d* m, expected an arc whose centre is not beyond the tool"),
    ({"corner_radius": 2 * MM, "corner_radial": 1 * MM}, "expected an arc that meets the flank"),
    ({"corner_radius": 2 * MM, "corner_radial": 7 * MM, "corner_axial": 20 * MM}, "expected an arc that meets"),
    ({"corner_axial": 1 * MM}, "corner offsets is .* expected none without a corner radius"),
    ({"corner_radius": -1 * MM}, "corner radius is -0.001 m"),
    ({"corner_radius": math.nan}, "corner radius is nan m"),
    ({"taper_angle": -30 * DEG}, "taper angle is .* expected a flank that does not close"),
    ({"taper_angle": 80 * DEG, "tip_angle": 60 * DEG}, "taper angle is .* expected a flank that leaves a tip"),
    ({"tip_angle": 90 * DEG}, "tip angle is"),
    ({"bottom_clearance": 2 * DEG, "tip_angle": 5 * DEG}, "bottom clearance is"),
    ({"wiper_length": 1 * MM}, "wiper length is 0.001 m, expected 0 where the whole bottom edge is flat"),
    ({"wiper_length": 9 * MM, "bottom_clearance": 2 * DEG}, "wiper length is .* at most the flat bottom's radius"),
    ({"helix_angles": (0.1,)}, "helix angles is .* expected 2 values"),
    ({"helix_angles": (0.1, 2.0)}, "helix angles is"),
    ({"axial_runout": (1e-6,)}, "axial runout is .* expected 2 values"),
    ({"axial_runout": (1e-6, math.inf)}, "axial runout is inf m"),
])
def test_tools_that_cannot_exist_are_refused(shape: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tool(Shape(**shape))


def test_flutes_must_reach_past_the_corner() -> None:
    with pytest.raises(ValueError, match=r"flute length is 0\.004 m, expected more than the height 0\.008 m"):
        Tool("t", 2 * R, 2, flute_length=4 * MM, shape=BALL)


@pytest.mark.parametrize(("top", "low", "message"), [
    (0.0, 0.0, "lowest height"), (40 * MM, 0.0, "depth is 0.04 m"), (5 * MM, 6 * MM, "lowest height is 0.006 m")])
def test_heights_outside_the_flutes_are_refused(top: float, low: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cutter_elements(tool(), top, low=low)
