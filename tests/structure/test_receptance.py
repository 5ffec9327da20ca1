"""Receptance coupling: pieces against the whole, there and back, and a chuck found again."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from turnmill_core.operation_structure import BeamMaterial, Chuck, ChuckMode, Support
from turnmill_core.structure.beam import free_bar, on_chuck, receptances, with_supports
from turnmill_core.structure.profile import BarProfile, cylinder
from turnmill_core.structure.receptance import (
    base_under,
    chuck_from_dummy,
    chuck_receptance,
    couple,
    end_receptances,
    fit_chuck,
    joint_compliance,
    on_base,
    on_support,
    seated_receptances,
)

AL = BeamMaterial(69.6e9, 2700.0, 0.33, 0.0002)
CHUCK = Chuck((ChuckMode(359.0, 0.015, 13.48, 0.26),), 2e9, 6.5e5, 2000.0, 40.0)
F = np.geomspace(20.0, 5000.0, 60)
SHAFT = BarProfile(np.array([0.0, 0.06, 0.1, 0.2]), np.array([0.02, 0.03, 0.025]))


def apart(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation relative to the size of each receptance at each frequency."""
    return float((np.abs(found - expected) / np.abs(expected)).max())


def test_a_shaft_cut_in_two_is_the_whole() -> None:
    """Pieces with the same elements, coupled rigidly (Eq. 4.57)."""
    whole = free_bar(cylinder(0.4, 0.05), AL, order=5, ends_at=[0.12])
    pieces = [end_receptances(free_bar(cylinder(length, 0.05), AL, order=5), F) for length in (0.12, 0.28)]
    found, expected = couple(*pieces), end_receptances(whole, F)
    for name in ("r11", "r12", "r21", "r22"):
        assert apart(getattr(found, name), getattr(expected, name)) < 1e-10


def test_a_stepped_shaft_from_its_steps() -> None:
    steps = [end_receptances(free_bar(SHAFT.part(a, b), AL, order=8), F)
             for a, b in ((0.0, 0.06), (0.06, 0.1), (0.1, 0.2))]
    found = couple(couple(steps[0], steps[1]), steps[2])
    assert apart(found.r11, end_receptances(free_bar(SHAFT, AL, order=8), F).r11) < 1e-9


def test_decouple_then_recouple_returns() -> None:
    bar, base = end_receptances(free_bar(SHAFT, AL), F), chuck_receptance(CHUCK, F)
    tip = on_base(bar, base)
    assert apart(base_under(bar, tip), base) < 1e-9
    assert apart(on_base(bar, base_under(bar, tip)), tip) < 1e-9


@pytest.mark.parametrize("chuck", [CHUCK, Chuck(), Chuck((ChuckMode(359.0, 0.015, 13.48),)),
                                   Chuck((), 5e7, math.inf, 100.0), Chuck((), math.inf, 3e5)])
def test_coupled_receptances_are_those_of_the_assembled_elements(chuck: Chuck) -> None:
    bar = free_bar(SHAFT, AL)
    assembled = on_chuck(bar, chuck)
    direct = receptances(assembled, assembled.reach[:2], F)
    assert apart(on_base(end_receptances(bar, F), chuck_receptance(chuck, F)), direct) < 1e-9


def test_an_elastic_joint_is_a_base_in_series() -> None:
    bar, base = end_receptances(free_bar(SHAFT, AL), F), chuck_receptance(Chuck(CHUCK.modes), F)
    joint = joint_compliance(CHUCK, F)
    assert apart(on_base(bar, base, joint), on_base(bar, chuck_receptance(CHUCK, F))) < 1e-12
    stiff = joint_compliance(Chuck((), 1e18, 1e18), F)
    assert apart(on_base(bar, base, stiff), on_base(bar, base)) < 1e-6


def test_a_tailstock_in_the_receptances_and_in_the_elements() -> None:
    bar = on_chuck(free_bar(SHAFT, AL), CHUCK)
    rows = np.vstack([bar.row(0.0), bar.row(0.05)])
    held = with_supports(bar, (Support(0.0, 4e7, 500.0),))
    coupled = on_support(receptances(bar, rows, F), 0, 4e7 + 2j * np.pi * F * 500.0)
    assert apart(coupled, receptances(held, rows, F)) < 1e-9


def dummy(chuck: Chuck) -> tuple[object, ...]:
    """Free dummy, measured places and the three FRFs of the dummy in the chuck."""
    bar = free_bar(cylinder(0.1, 0.06), AL)
    held = on_chuck(bar, chuck)
    H = receptances(held, np.vstack([held.row(0.0), held.row(0.04)]), F)
    return bar, (0.0, 0.04), F, H[:, 0, 0], H[:, 0, 1], H[:, 1, 1]


def test_the_whole_chuck_from_three_frfs() -> None:
    """All four receptances, rotation too, though only displacements were measured."""
    assert apart(chuck_from_dummy(*dummy(CHUCK)), chuck_receptance(CHUCK, F)) < 1e-7


def test_dummy_decoupled_and_coupled_again() -> None:
    bar, points, f, H11, H12, H22 = dummy(CHUCK)
    base = chuck_from_dummy(bar, points, f, H11, H12, H22)
    again = seated_receptances(bar, np.vstack([bar.row(0.0), bar.row(0.04)]), base, f)
    for found, expected in ((again[:, 0, 0], H11), (again[:, 0, 1], H12), (again[:, 1, 1], H22)):
        assert apart(found, expected) < 1e-9


def test_seated_is_coupled() -> None:
    """Any point of the bar, by the held bar and by Eq. 4.58."""
    bar, base = free_bar(SHAFT, AL), chuck_receptance(CHUCK, F)
    found = seated_receptances(bar, bar.reach[:2], base, F)
    assert apart(found, on_base(end_receptances(bar, F), base)) < 1e-9
    assembled = on_chuck(bar, CHUCK)
    rows = np.vstack([bar.row(0.07), bar.row(0.15)])
    direct = receptances(assembled, np.vstack([assembled.row(0.07), assembled.row(0.15)]), F)
    assert apart(seated_receptances(bar, rows, base, F), direct) < 1e-9


def test_translation_alone_does_not_give_the_bars_modes() -> None:
    """What a measured translational FRF of the chuck hides: with it alone the second mode is far off."""
    bar = end_receptances(free_bar(cylinder(0.12, 0.1), AL), np.arange(100.0, 4000.0, 1.0))
    full = chuck_receptance(CHUCK, np.arange(100.0, 4000.0, 1.0))
    half = full.copy()
    half[:, 0, 1] = half[:, 1, 0] = half[:, 1, 1] = 0
    peaks = []
    for base in (full, half):
        H = np.abs(on_base(bar, base)[:, 0, 0])
        peaks.append(np.flatnonzero((H[1:-1] > H[:-2]) & (H[1:-1] > H[2:])) + 101.0)
    assert peaks[0][1] < 1300 < 2500 < peaks[1][1]


@pytest.mark.parametrize(("noise", "within"), [(0.0, 1e-4), (2e-3, 0.05)])
def test_a_chucks_parameters_from_the_dummy(noise: float, within: float) -> None:
    """With noise relative to the largest value of each receptance."""
    chuck = Chuck(CHUCK.modes, math.inf, 6.5e5, 0.0, 40.0)
    bar, points, _, *_ = dummy(chuck)
    f, rng = np.arange(60.0, 2500.0, 8.0), np.random.default_rng(2)
    held = on_chuck(bar, chuck)  # type: ignore[arg-type]
    H = receptances(held, np.vstack([held.row(0.0), held.row(0.04)]), f)
    H = H + noise * np.abs(H).max(axis=0) * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape))
    found = fit_chuck(bar, points, f, H[:, 0, 0], H[:, 0, 1], H[:, 1, 1])  # type: ignore[arg-type]
    mode, true = found.modes[0], chuck.modes[0]
    assert mode.frequency == pytest.approx(true.frequency, rel=max(within / 5, 1e-4))
    for name in ("damping", "mass", "pivot"):
        assert getattr(mode, name) == pytest.approx(getattr(true, name), rel=max(2 * within, 1e-3)), name
    assert found.rotational_stiffness == pytest.approx(6.5e5, rel=max(within, 1e-3))
    assert found.stiffness > 1e9


@pytest.mark.parametrize("seed", range(4))
def test_rounding_does_not_decide_whether_the_chuck_is_found(seed: int) -> None:
    chuck = Chuck(CHUCK.modes, math.inf, 6.5e5, 0.0, 0.0)
    bar, points, _, *_ = dummy(chuck)
    f, rng = np.arange(100.0, 1600.0, 10.0), np.random.default_rng(seed)
    held = on_chuck(bar, chuck)  # type: ignore[arg-type]
    H = receptances(held, np.vstack([held.row(0.0), held.row(0.04)]), f)
    H = H * (1 + 1e-12 * rng.normal(size=H.shape))
    found = fit_chuck(bar, points, f, H[:, 0, 0], H[:, 0, 1], H[:, 1, 1])  # type: ignore[arg-type]
    np.testing.assert_allclose(chuck_receptance(found, f), chuck_receptance(chuck, f), rtol=1e-4, atol=0)


@pytest.mark.parametrize(("change", "message"), [
    ({"points": (0.02, 0.02)}, "different places"), ({"points": (0.0, 0.3)}, "place on the bar"),
    ({"frequency": np.zeros(60)}, "frequency"), ({"H11": np.full(60, np.nan)}, "H11"), ({"H22": np.ones(3)}, "H22"),
])
def test_impossible_dummies_are_refused(change: dict[str, object], message: str) -> None:
    names = ("bar", "points", "frequency", "H11", "H12", "H22")
    good = dict(zip(names, dummy(CHUCK), strict=True))
    with pytest.raises(ValueError, match=message):
        chuck_from_dummy(**{**good, **change})


@pytest.mark.parametrize(("kind", "field", "value"), [
    (CHUCK.modes[0], "mass", -1.0), (CHUCK.modes[0], "damping", 1.5), (CHUCK.modes[0], "pivot", 0.0),
    (CHUCK, "stiffness", 0.0), (CHUCK, "rotational_damping", -1.0), (AL, "density", 0.0), (AL, "poisson_ratio", 0.5),
    (AL, "youngs_modulus", math.nan), (Support(0.1, 1e7), "stiffness", -1e7), (Support(0.1, 1e7), "position", -0.1),
])
def test_impossible_chucks_and_materials_are_refused(kind: object, field: str, value: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        dataclasses.replace(kind, **{field: value})  # type: ignore[type-var]
