"""Surface errors: closed forms, limits, and the envelope against brute force and kinematics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.process.cases import ALUMINIUM, RPM, at, milling, turn_milling
from turnmill_core.operation import Mode, Operation, Shape
from turnmill_core.process._kernels import envelope as kernels
from turnmill_core.process.linear import linear_map
from turnmill_core.process.linear_cut import linear_cut
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.surface import forced_response, form_error, printed_extremes, steady_axial
from turnmill_core.process.surface_map import bottom_of, surface_map, tooth_print
from turnmill_core.process.surface_profile import (
    circularity_error,
    cusp_at,
    static_cusp,
    surface_feed_per_tooth,
    surface_shift,
    wiper_overlap,
)

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DISH = math.radians(2.73)
FLEXIBLE = (Mode(782.0, 0.02, 0.7, X), Mode(810.0, 0.03, 0.9, Y), Mode(1900.0, 0.03, 0.5, Z))
STILL = turn_milling((), speed=3000 * RPM, workpiece_speed=10 * RPM, depth=1e-3, axial_feed=6e-3)


def dished(op: Operation, wiper: float = 0.0, **shape: object) -> Operation:
    """`op` with a bottom that rises by 2.73 degrees behind a wiper."""
    return replace(op, tool=replace(op.tool, shape=Shape(bottom_clearance=DISH, wiper_length=wiper, **shape)))  # type: ignore[arg-type]


def test_circularity_in_closed_form() -> None:
    """Eq. 4.130 to round-off, and without cancellation where the angle is tiny."""
    radius, tool, workpiece = 22.2e-3, 4000 * RPM, 60 * RPM
    theta = 2 * math.pi * workpiece / (tool * 2)
    assert circularity_error(radius, workpiece, tool, 2) == pytest.approx(radius * (1 / math.cos(theta / 2) - 1),
                                                                         rel=1e-9)
    tiny = circularity_error(radius, 1e-6 * workpiece, tool, 2)
    assert tiny == pytest.approx(radius * (theta * 1e-6 / 2) ** 2 / 2, rel=1e-9)
    with pytest.raises(ValueError, match="workpiece speed"):
        circularity_error(radius, tool, tool, 2)


def test_cusp_wiper_and_overlap_in_closed_form() -> None:
    """Eq. 4.131, 4.133, 4.134 (erratum D10) to round-off."""
    assert static_cusp(0.4e-3, DISH) == 0.4e-3 * math.tan(DISH)
    assert cusp_at(0.1e-3, DISH) == 0.1e-3 * math.tan(DISH)
    assert static_cusp(0.4e-3, DISH, 0.1e-3) == pytest.approx(0.3e-3 * math.tan(DISH), rel=1e-15)
    assert static_cusp(0.4e-3, DISH, 0.4e-3) == 0.0
    period = 60 / 4000 / 2
    shift = surface_shift(23e-3, 6 * RPM, period)
    assert shift == 2 * 23e-3 * math.sin(6 * RPM * period / 2)
    assert shift == pytest.approx(0.108e-3, abs=5e-7)
    assert wiper_overlap(1e-3, shift) == 1e-3 - shift
    assert wiper_overlap(1e-5, shift) == 0.0


def test_form_error_adds_up() -> None:
    op = dished(turn_milling(FLEXIBLE))
    error = form_error(op, op.conditions)
    assert error.circularity == pytest.approx(circularity_error(21e-3, 6 * RPM, 3000 * RPM, 2), rel=1e-12)
    assert error.cusp == static_cusp(surface_feed_per_tooth(op, op.conditions), DISH)
    assert error.overcut > error.undercut >= 0  # the axial force pulls the tool into the workpiece
    assert error.total == error.circularity + error.cusp + error.overcut
    rigid = form_error(dished(STILL), STILL.conditions)
    assert rigid.undercut == rigid.overcut == 0
    assert form_error(op, replace(op.conditions, depth=-1e-3)).total == 0
    with pytest.raises(ValueError, match="process is"):
        form_error(milling(), milling().conditions)


def test_estimated_and_true_steady_vibration_agree() -> None:
    """The static force through the receptance is the periodic orbit to the order of Omega_c / Omega_t."""
    op = turn_milling(FLEXIBLE, helix_angle=math.radians(25))
    angle, moved = forced_response(op, op.conditions)
    steady = periodic_orbit(linear_map(linear_cut(op, op.conditions)))
    expected = np.array([np.interp(angle, steady.angle, column) for column in steady.relative.T]).T
    assert np.all(np.abs(moved - expected).max(axis=0) < 0.02 * np.abs(expected).max(axis=0))
    at_angle, axial = steady_axial(op, op.conditions)
    np.testing.assert_allclose(printed_extremes(op, op.conditions, angle, moved[:, 2]),
                               printed_extremes(op, op.conditions, at_angle, axial), atol=2e-9)


def test_flat_bottom_leaves_the_polygon() -> None:
    """Without cusp and vibration only Eq. 4.130 is left, in height, mean radius and section of the polygon.

    600 teeth to a workpiece revolution, so that all revolutions cut the same facets. While an edge swings from the
    middle of a facet to its end, x/y [rad], the workpiece moves on, so the facets seen at y are shorter than those of
    the closed form by 1 + v/(Omega_t y); the nearest leading row y = v_axial decides.
    """
    op = STILL
    found = surface_map(op, op.conditions, around=2 * math.pi / 600, columns=500, rows=7)
    assert found.overcut < 1e-15
    half = math.pi / 600 / (1 + 10 * RPM * found.radius / (3000 * RPM * found.axial))
    assert found.height.max(axis=1) == pytest.approx(found.radius * (1 / np.cos(half) - 1), rel=5e-3)
    mean = found.radius * (np.log(np.tan(math.pi / 4 + half / 2)) / half - 1)
    assert found.height.mean(axis=1) == pytest.approx(mean, rel=2e-3)
    section = found.radius**2 * (np.tan(half) / half - 1)
    assert np.mean((found.radius + found.height) ** 2, axis=1) - found.radius**2 == pytest.approx(section, rel=2e-3)
    far = replace(op, conditions=replace(op.conditions, tool_speed=3e6 * RPM, workpiece_speed=1e4 * RPM,
                                         feed_speed=6e-3 * 1e4 / 60))
    corner = circularity_error(22e-3, 1e4 * RPM, 3e6 * RPM, 2)
    assert surface_map(far, far.conditions, around=2 * math.pi / 600, columns=500, rows=3).undercut <= corner


def test_volume_removed_is_that_of_the_kinematics() -> None:
    """Bar minus map, times the axial feed: Omega_c f_a a (2 R_w - a) / 2 per time (Eq. 5.1)."""
    op = at(STILL, tool_speed=9000 * RPM)
    found = surface_map(op, op.conditions, around=0.02)
    removed = (math.pi * op.workpiece.radius**2 - found.mean_section) * op.axial_feed
    rate = op.conditions.feed_speed * math.pi * 1e-3 * (2 * op.workpiece.radius - 1e-3)
    assert removed * op.conditions.workpiece_speed / (2 * math.pi) == pytest.approx(rate, rel=2e-5)


def test_wiper_longer_than_the_feed_removes_the_cusp() -> None:
    """Print of a tooth: the feed per tooth counts. Finished surface: the axial feed per revolution does."""
    feed = surface_feed_per_tooth(STILL, STILL.conditions)
    for wiper, gone in ((0.0, False), (0.5 * feed, False), (1.001 * feed, True)):
        made = tooth_print(dished(STILL, wiper), STILL.conditions)
        assert (made.height.max() == 0) == gone
        assert made.height.max() == pytest.approx(static_cusp(feed, DISH, wiper), rel=1e-12)
    corner = circularity_error(22e-3, 10 * RPM, 3000 * RPM, 2)
    assert surface_map(dished(STILL, 6.1e-3), STILL.conditions, around=0.03).undercut <= corner * (1 + 1e-9)
    assert surface_map(dished(STILL, 1e-3), STILL.conditions, around=0.03).undercut > 100 * corner


def test_dish_leaves_a_thread() -> None:
    """Tips of leading and trailing side pass R ahead of and behind the axis; between them the dish rises.

    R = 10 mm and f_a = 6 mm: tracks at 4 and at 2 of 6 mm. Inside the tool from a leading track the surface is
    (track - v) tan(alpha), from a trailing one (v - track) tan(alpha), the lower of the two.
    """
    op = dished(STILL)
    found = surface_map(op, op.conditions, around=0.02, rows=60)
    v = found.axial[:, None]
    leading = np.array([10e-3 + 6e-3 * k for k in range(-5, 6)])
    trailing = np.array([-10e-3 + 6e-3 * k for k in range(-5, 6)])
    distance = np.concatenate([leading - v, v - trailing], axis=1)
    behind = np.where(distance >= 0, distance, np.inf).min(axis=1)
    np.testing.assert_allclose(found.height.mean(axis=1), behind * math.tan(DISH), atol=2e-6)
    assert found.undercut == pytest.approx(4e-3 * math.tan(DISH), abs=2e-6)


def brute_force(op: Operation, angle: float, axial: float, vibration: np.ndarray, turns: int) -> float:
    """Lowest height of all passes over one place: every instant of a fine grid at which an edge is over it."""
    cut, bottom = op.conditions, bottom_of(op)[0]
    speed, radius = abs(cut.workpiece_speed), cut.effective_radius
    sense = 1.0 if sum(cut.cross_feed_span) >= 0 else -1.0
    lowest = math.inf
    for n in range(-turns, turns + 1):
        under = (angle + 2 * math.pi * n) / speed
        t = under + np.linspace(-0.2, 0.2, 120_001) / speed
        x = radius * np.tan(speed * (under - t)) + math.copysign(1, cut.workpiece_speed) * op.eccentricity
        y = axial - sense * cut.feed_speed * t
        for j, offset in enumerate(np.cumsum((0.0, *op.tool.pitch[:-1]))):
            ahead = np.mod(cut.tool_speed * t + offset - np.arctan2(x, y) + math.pi, 2 * math.pi) - math.pi
            crossed = np.nonzero((ahead[:-1] < 0) & (ahead[1:] >= 0) & (ahead[1:] - ahead[:-1] < 1))[0]
            for i in crossed:
                place = np.mod(cut.tool_speed * t[i], 2 * math.pi) / (2 * math.pi) * vibration.size
                moved = np.interp(place, np.arange(vibration.size + 1), np.append(vibration, vibration[0]))
                runout = (op.tool.shape.axial_runout or (0.0,) * op.tool.teeth)[j]
                up = kernels.bottom_height(math.hypot(x[i], y[i]), bottom) + moved - runout
                lowest = min(lowest, (radius + up) / math.cos(speed * (under - t[i])) - radius)
    return lowest


@pytest.mark.parametrize(("eccentricity", "sense"), [(0.0, "up"), (3e-3, "down")])
def test_surface_of_an_eccentric_tool_that_vibrates(eccentricity: float, sense: str) -> None:
    """Form error and map take the numeric engagement; a tool just beside the axis is as good as one on it."""
    op = dished(turn_milling(FLEXIBLE, sense=sense))
    beside = replace(op, eccentricity=1e-9 if eccentricity == 0 else eccentricity)
    found, centred = form_error(beside, op.conditions), form_error(op, op.conditions)
    assert found.overcut > 0
    if eccentricity == 0:
        assert found.overcut == pytest.approx(centred.overcut, rel=0.02)
        lowest, plain = (surface_map(o, op.conditions, around=0.01, columns=10, rows=8).height for o in (beside, op))
        np.testing.assert_allclose(lowest, plain, atol=3e-8)


@pytest.mark.parametrize(("eccentricity", "sense"), [(0.0, "up"), (3e-3, "down")])
def test_envelope_against_brute_force(eccentricity: float, sense: str) -> None:
    """Dish, corner, wiper, axial runout, uneven pitch, vibration, eccentric tool, both senses."""
    op = turn_milling((), speed=500 * RPM, workpiece_speed=8 * RPM, depth=1e-3, sense=sense, teeth=3, axial_feed=5e-3,
                      pitch_angles=(2.0, 2.1, 2 * math.pi - 4.1))
    op = dished(op, 0.5e-3, corner_radius=0.2e-3, axial_runout=(5e-6, 0.0, -5e-6))
    op = replace(op, eccentricity=eccentricity)
    phase = np.arange(360) * (2 * math.pi / 360)
    vibration = 4e-6 * np.sin(3 * phase) + 2e-6 * np.cos(7 * phase)
    found = surface_map(op, op.conditions, around=0.5, columns=2, rows=3, vibration=(phase, vibration))
    assert surface_map(op, op.conditions, around=0.02, rows=150, vibration=(phase, vibration)).undercut < 9e-4
    for i in range(3):
        for j in range(2):
            expected = brute_force(op, found.angle[j], found.axial[i], vibration, 3)
            assert found.height[i, j] == pytest.approx(expected, abs=3e-8)


def test_vibration_is_printed() -> None:
    """A tool that stands 3 um too low all the time leaves a surface that is 3 um too low."""
    op = dished(STILL)
    plain, lower = (surface_map(op, op.conditions, around=0.05, columns=40, rows=20,
                                vibration=(np.zeros(1), np.full(1, z))) for z in (0.0, -3e-6))
    np.testing.assert_allclose(lower.height, plain.height - 3e-6, atol=2e-10)
    assert lower.undercut == pytest.approx(plain.undercut - 3e-6, abs=1e-9)


def test_kernel_and_its_plain_version_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    op = dished(turn_milling((), speed=900 * RPM, workpiece_speed=8 * RPM, depth=1e-3), 0.5e-3, corner_radius=0.2e-3)
    vibration = (np.zeros(4), np.array([0.0, 1e-6, -1e-6, 2e-6]))
    compiled = surface_map(op, op.conditions, around=0.1, columns=6, rows=5, vibration=vibration).height
    for name in ("_ahead", "bottom_height", "_lowest_pass"):
        monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    monkeypatch.setattr("turnmill_core.process.surface_map.envelope", kernels.envelope.py_func)
    plain = surface_map(op, op.conditions, around=0.1, columns=6, rows=5, vibration=vibration).height
    np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-15)


def test_bad_questions() -> None:
    block = milling(material=ALUMINIUM)
    for wrong, what in (
        (lambda: surface_map(block, block.conditions), "process is"),
        (lambda: surface_map(STILL, replace(STILL.conditions, depth=0.0)), "depth is"),
        (lambda: surface_map(STILL, STILL.conditions, around=7.0), "angle around is"),
        (lambda: surface_map(STILL, STILL.conditions, columns=10**6, rows=100), "cells is"),
        (lambda: surface_map(replace(STILL, tilt=0.1), STILL.conditions), "tilt is"),
    ):
        with pytest.raises(ValueError, match=what):
            wrong()
