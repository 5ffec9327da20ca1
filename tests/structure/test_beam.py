"""Beam elements against closed forms and against an exact transfer matrix."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from turnmill_core.operation_structure import BeamMaterial, Chuck, Support
from turnmill_core.structure.beam import (
    damped_modes,
    free_bar,
    normal_modes,
    on_chuck,
    receptances,
    shear_coefficient,
    with_supports,
)
from turnmill_core.structure.profile import cylinder

STEEL = BeamMaterial(200e9, 7860.0, 0.29)
SIZES = [(1.0, 0.01), (0.5, 0.1), (0.12, 0.06)]  # slender, thick, stubby; length and diameter [m]


def constants(diameter: float) -> tuple[float, float, float, float]:
    """EI, k G A, rho A, rho I of a solid steel bar."""
    area, inertia = math.pi * diameter**2 / 4, math.pi * diameter**4 / 64
    G = STEEL.youngs_modulus / (2 * (1 + STEEL.poisson_ratio))
    k = shear_coefficient("cowper", STEEL.poisson_ratio)
    return STEEL.youngs_modulus * inertia, k * G * area, STEEL.density * area, STEEL.density * inertia


def transfer(w: float, length: float, diameter: float) -> np.ndarray:
    """Exact transfer matrix of (y, rotation, moment, shear force) over the bar at w [rad/s]."""
    EI, kGA, rhoA, rhoI = constants(diameter)
    return expm(length * np.array([
        [0, 1, 0, 1 / kGA], [0, 0, 1 / EI, 0], [0, -rhoI * w**2, 0, -1], [-rhoA * w**2, 0, 0, 0]]))


def exact_frequencies(length: float, diameter: float, start: list[int], end: list[int], count: int) -> np.ndarray:
    """Roots of the determinant: components `start` are free at one end, components `end` vanish at the other."""
    EI, _, rhoA, _ = constants(diameter)
    unit = math.sqrt(EI / rhoA) / length**2

    def det(w: float) -> float:
        T = transfer(w, length, diameter) * np.array([1, 1 / length, EI / length**2, EI / length**3])
        T[1] *= length
        T[2] *= length**2 / EI
        T[3] *= length**3 / EI
        return float(np.linalg.det(T[np.ix_(end, start)]))

    grid = unit * np.geomspace(0.5, 250, 1500)
    values = [det(w) for w in grid]
    roots = [brentq(det, a, b, rtol=1e-12) for a, b, f, g in zip(grid, grid[1:], values, values[1:], strict=False)
             if f * g < 0]
    return np.array(roots[:count]) / (2 * np.pi)


@pytest.mark.parametrize(("length", "diameter"), SIZES)
def test_free_free(length: float, diameter: float) -> None:
    found = normal_modes(free_bar(cylinder(length, diameter), STEEL), 5).frequency
    exact = exact_frequencies(length, diameter, [0, 1], [2, 3], 3)
    assert np.all(found[:2] < 1e-2 * exact[0])
    np.testing.assert_allclose(found[2:], exact, rtol=1e-6)


@pytest.mark.parametrize(("length", "diameter"), SIZES)
def test_cantilever(length: float, diameter: float) -> None:
    found = normal_modes(on_chuck(free_bar(cylinder(length, diameter), STEEL), Chuck()), 3).frequency
    np.testing.assert_allclose(found, exact_frequencies(length, diameter, [2, 3], [2, 3], 3), rtol=1e-6)


@pytest.mark.parametrize(("length", "diameter"), SIZES)
def test_pinned_on_both_ends(length: float, diameter: float) -> None:
    """EI b^4 - (rho A + (rho I + EI rho A / kGA) b^2) w^2 + rho A rho I / kGA w^4 = 0, b = n pi / L; or shear alone."""
    EI, kGA, rhoA, rhoI = constants(diameter)
    pins = tuple(Support(s, 1e9 * EI / length**3) for s in (0.0, length))
    found = normal_modes(with_supports(free_bar(cylinder(length, diameter), STEEL), pins), 3).frequency
    exact = [kGA / rhoI]  # pure shear: y = 0, the sections turn alike
    for n in (1, 2, 3):
        b = n * math.pi / length
        exact += np.roots([rhoA * rhoI / kGA, -(rhoA + (rhoI + EI * rhoA / kGA) * b**2), EI * b**4]).real.tolist()
    np.testing.assert_allclose(found, np.sqrt(sorted(exact)[:3]) / (2 * math.pi), rtol=1e-5)


def test_slender_limit_is_eulers_beam() -> None:
    EI, _, rhoA, _ = constants(0.004)
    unit = math.sqrt(EI / rhoA) / (2 * math.pi)
    bar = free_bar(cylinder(1.0, 0.004), STEEL)
    np.testing.assert_allclose(normal_modes(bar, 5).frequency[2:],
                               unit * np.array([4.73004074, 7.85320462, 10.9956078]) ** 2, rtol=1e-3)
    np.testing.assert_allclose(normal_modes(on_chuck(bar, Chuck()), 3).frequency,
                               unit * np.array([1.87510407, 4.69409113, 7.85475744]) ** 2, rtol=1e-3)


def test_convergence_order() -> None:
    """Elements of order p: the error of a frequency falls with the power 2 p of their length."""
    exact = exact_frequencies(0.5, 0.1, [2, 3], [2, 3], 3)[2]
    counts = np.array([8, 16, 32])
    for order in (2, 3):
        errors = []
        for n in counts:
            bar = free_bar(cylinder(0.5, 0.1), STEEL, order=order, ends_at=np.linspace(0, 0.5, n + 1))
            errors.append(normal_modes(on_chuck(bar, Chuck()), 3).frequency[2] / exact - 1)
        assert min(errors) > 0
        assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(2 * order, abs=0.35)


def test_static_deflection_of_a_cantilever() -> None:
    """L^3 / 3 EI + L / kGA, to rounding: the elements are exact in statics."""
    length, diameter = 0.5, 0.1
    EI, kGA, *_ = constants(diameter)
    bar = on_chuck(free_bar(cylinder(length, diameter), STEEL), Chuck())
    H = receptances(bar, bar.row(0.0), [0.0])
    assert H[0, 0, 0].real == pytest.approx(length**3 / (3 * EI) + length / kGA, rel=1e-9)


def test_mass_and_centre_of_a_rigid_motion() -> None:
    """The consistent mass of a rigid translation is the bar's, of a rotation about the end its moment of inertia."""
    length, diameter = 0.3, 0.05
    bar = free_bar(cylinder(length, diameter), STEEL)
    _, _, rhoA, rhoI = constants(diameter)
    shift, turn = np.tile([1.0, 0.0], bar.nodes.size), np.column_stack([bar.nodes, np.ones_like(bar.nodes)]).ravel()
    assert shift @ bar.M @ shift == pytest.approx(rhoA * length, rel=1e-12)
    assert turn @ bar.M @ turn == pytest.approx(rhoA * length**3 / 3 + rhoI * length, rel=1e-12)
    assert np.abs(bar.K @ np.column_stack([shift, turn])).max() < 1e-9 * np.abs(bar.K).max()


def test_shear_coefficients() -> None:
    """Both by their printed formulas; equal at nu = 0 (6/7)."""
    assert shear_coefficient("cowper", 0.3) == pytest.approx(6 * 1.3 / (7 + 1.8))
    assert shear_coefficient("hutchinson", 0.3) == pytest.approx(6 * 1.69 / (7 + 3.6 + 0.36))
    assert shear_coefficient("cowper", 0.0) == shear_coefficient("hutchinson", 0.0) == pytest.approx(6 / 7)
    with pytest.raises(ValueError, match="shear coefficient"):
        shear_coefficient("timoshenko", 0.3)  # type: ignore[arg-type]


def test_the_loss_factor_is_twice_the_damping_of_a_clamped_bar() -> None:
    lossy = BeamMaterial(200e9, 7860.0, 0.29, 0.002)
    modes = normal_modes(on_chuck(free_bar(cylinder(0.5, 0.1), lossy), Chuck()), 3)
    np.testing.assert_allclose(modes.damping, 0.001, rtol=1e-9)


def test_a_stepped_bar_of_one_diameter_is_the_plain_one() -> None:
    plain = cylinder(0.4, 0.06)
    found = [normal_modes(free_bar(bar, STEEL), 5).frequency for bar in (plain, plain.split([0.12, 0.3]))]
    np.testing.assert_allclose(*found, rtol=1e-8, atol=0.1)


def test_damped_modes_are_the_poles_of_the_elements() -> None:
    """Frequency and damping against the eigenvalues of the whole system, with a strong damper at one place."""
    held = with_supports(free_bar(cylinder(0.4, 0.04), STEEL), (Support(0.4, 4e8, 0.0), Support(0.25, 2e7, 900.0)))
    n = held.M.shape[0]
    inverse = np.linalg.inv(held.M)
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ held.K, -inverse @ held.C]]))
    poles = sorted(poles[poles.imag > 0], key=abs)[:3]
    found = damped_modes(held, 3)
    np.testing.assert_allclose(found.frequency, np.abs(poles) / (2 * np.pi), rtol=1e-4)
    np.testing.assert_allclose(found.damping, -np.real(poles) / np.abs(poles), rtol=1e-2)


def test_damped_modes_of_proportional_damping_are_the_normal_ones() -> None:
    lossy = on_chuck(free_bar(cylinder(0.5, 0.1), BeamMaterial(200e9, 7860.0, 0.29, 0.002)), Chuck())
    normal, damped = normal_modes(lossy, 3), damped_modes(lossy, 3)
    np.testing.assert_allclose(damped.frequency, normal.frequency, rtol=1e-5)
    np.testing.assert_allclose(damped.damping, normal.damping, rtol=1e-5)
    np.testing.assert_allclose(np.abs(damped.shapes), np.abs(normal.shapes), rtol=1e-4, atol=1e-6)
