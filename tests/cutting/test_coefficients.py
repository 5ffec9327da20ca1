"""Oblique transformation: vector equilibrium, limits, inverse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnmill_core.cutting.coefficients import OrthogonalData, oblique_coefficients, orthogonal_data

angle = st.floats(math.radians(5), math.radians(40))
CASE = (OrthogonalData(613e6, math.radians(30), math.radians(25)), math.radians(5), math.radians(30))


@settings(max_examples=200, deadline=None)
@given(st.floats(1e8, 1e9), angle, angle, st.floats(-0.2, 0.3), st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_force_stands_in_equilibrium_on_rake_face_and_shear_plane(
    stress: float, shear: float, friction: float, rake: float, i: float, eta: float
) -> None:
    """The coefficients as a force vector: friction lies along the chip flow, and shear on the shear plane is tau."""
    ktc, krc, kac = oblique_coefficients(OrthogonalData(stress, shear, friction), rake, i, eta)
    # edge axes: x normal to the edge in the cut surface, y along the edge, z out of the surface; area 1
    velocity = np.array([math.cos(i), math.sin(i), 0.0])
    across = np.array([math.sin(i), -math.cos(i), 0.0])
    force = -ktc * velocity + krc * np.array([0, 0, 1.0]) - kac * across  # chip on tool
    into_rake = np.array([-math.cos(rake), 0.0, -math.sin(rake)])
    up_rake = np.array([-math.sin(rake), 0.0, math.cos(rake)])
    flow = math.cos(eta) * up_rake - math.sin(eta) * np.array([0, 1.0, 0])
    pressure = force @ into_rake
    on_face = force - pressure * into_rake
    # friction along the flow, its normal-plane angle as given
    assert np.cross(on_face, flow) == pytest.approx(np.zeros(3), abs=1e-9 * np.linalg.norm(force))
    assert on_face @ up_rake == pytest.approx(pressure * math.tan(friction), rel=1e-9)
    plane_normal = np.array([-math.sin(shear), 0.0, math.cos(shear)])  # the plane rises ahead of the edge
    on_plane = force - (force @ plane_normal) * plane_normal
    area = 1 / (math.sin(shear) * math.cos(i))
    assert np.linalg.norm(on_plane) / area == pytest.approx(stress, rel=1e-9)


def test_no_inclination_is_orthogonal_cutting() -> None:
    """Merchant: K_t = tau cos(beta - alpha) / (sin(phi) cos(phi + beta - alpha)), no axial force."""
    data, rake, _ = CASE
    phi, beta = data.shear_angle, data.friction_angle
    ktc, krc, kac = oblique_coefficients(data, rake, 0.0)
    scale = data.shear_stress / (math.sin(phi) * math.cos(phi + beta - rake))
    assert (ktc, krc) == pytest.approx((scale * math.cos(beta - rake), scale * math.sin(beta - rake)))
    assert kac == pytest.approx(0, abs=1e-6)


def test_axial_coefficient_has_the_minus() -> None:
    """With the printed plus the chip would have to flow against its friction (erratum M8)."""
    data, rake, i = CASE
    _, _, kac = oblique_coefficients(data, rake, i)
    beta, t = data.friction_angle, math.tan(i)
    length = math.hypot(math.cos(data.shear_angle + beta - rake), t * math.sin(beta))
    scale = data.shear_stress / (math.sin(data.shear_angle) * length)
    assert kac == pytest.approx(scale * t * (math.cos(beta - rake) - math.sin(beta)))


def test_reversed_inclination_reverses_the_axial_force_only() -> None:
    data, rake, i = CASE
    there, back = (oblique_coefficients(data, rake, x) for x in (i, -i))
    assert back == pytest.approx((there[0], there[1], -there[2]))


def test_friction_on_the_rake_face_is_less_on_the_normal_plane() -> None:
    data, rake, i = CASE
    normal = OrthogonalData(data.shear_stress, data.shear_angle, math.atan(math.tan(data.friction_angle) * math.cos(i)))
    assert oblique_coefficients(data, rake, i, friction_on_rake=True) == pytest.approx(
        oblique_coefficients(normal, rake, i))


@settings(max_examples=200, deadline=None)
@given(st.floats(1e8, 1e9), angle, angle, st.floats(-0.2, 0.3), st.floats(-0.8, 0.8), st.floats(-0.8, 0.8))
def test_inverse_to_round_off(stress: float, shear: float, friction: float, rake: float, i: float, eta: float) -> None:
    data = OrthogonalData(stress, shear, friction)
    found, flow = orthogonal_data(oblique_coefficients(data, rake, i, eta), rake, i, shear)
    assert found.shear_stress == pytest.approx(stress, rel=1e-11)
    assert found.friction_angle == pytest.approx(friction, rel=1e-11)
    assert flow == pytest.approx(eta, abs=1e-11)


@pytest.mark.parametrize(("kwargs", "message"), [
    ({"shear_stress": -1.0}, "shear stress is -1.0 Pa"), ({"shear_angle": 0.0}, "shear angle is 0.0 rad"),
    ({"friction_angle": 1.6}, "friction angle is 1.6 rad")])
def test_bad_data(kwargs: dict[str, float], message: str) -> None:
    good = {"shear_stress": 5e8, "shear_angle": 0.5, "friction_angle": 0.4}
    with pytest.raises(ValueError, match=message):
        OrthogonalData(**{**good, **kwargs})


def test_bad_angles() -> None:
    data, rake, i = CASE
    with pytest.raises(ValueError, match=r"inclination is 1\.7 rad"):
        oblique_coefficients(data, rake, 1.7)
    with pytest.raises(ValueError, match=r"shear angle \+ friction angle"):
        oblique_coefficients(OrthogonalData(5e8, 1.4, 0.6), 0.0, i)
    with pytest.raises(ValueError, match="friction angle is"):
        orthogonal_data((1e9, -5e8, 0.0), 0.0, 0.2, 0.5)
