"""Contact points, torsion, cross modes and complex residues (thesis 4.3.1)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from turnmill_core.operation_structure import CrossMode, Mode, Structure
from turnmill_core.structure.complex_modes import checked_phases
from turnmill_core.structure.modal import (
    ContactModes,
    ModalModel,
    contact_modes,
    cross_frf_modes,
    frf,
    join,
    modal_model,
    state_space,
)

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
HEIGHTS = (0.0, 0.01, 0.02)
LONG = Structure((
    Mode(700.0, 0.03, 1.2, (1.0, 0.2, 0.0), 0.0, ((0.9, 0.18, 0.0), (0.7, 0.14, 0.0))),
    Mode(2500.0, 0.02, 0.4, (0.0, 0.0, 0.1), 40.0, ((0.0, 0.0, 0.1), (0.0, 0.0, 0.1))),
), "tool", HEIGHTS)
BAR = Structure((Mode(330.0, 0.02, 5.0, X),), "tool")
CROSS = CrossMode(326.0, 0.0072, 34.1, "xy")
F = np.array([100.0, 329.0, 700.0, 2490.0])


def test_receptances_between_all_contact_points() -> None:
    """Eq. 4.42, 4.43: four directions a point, each entry the sum of the modes' u_i u_j / m."""
    model = contact_modes(LONG, BAR)
    phi = model.frf(F)
    assert phi.shape == (4, 12, 12)
    np.testing.assert_allclose(phi, phi.swapaxes(1, 2), rtol=1e-12)
    w, expected = 2 * np.pi * F, np.zeros((4, 12, 12), dtype=complex)
    for mode, sign in ((LONG.modes[0], 1), (LONG.modes[1], 1), (BAR.modes[0], -1)):
        shapes = [mode.shape, *(mode.above or (mode.shape, mode.shape))]
        u = sign * np.concatenate([[*shape, mode.torsion] for shape in shapes])
        wn = 2 * np.pi * mode.frequency
        gain = 1 / (mode.mass * (wn**2 - w**2 + 2j * mode.damping * wn * w))
        expected += gain[:, None, None] * np.outer(u, u)
    np.testing.assert_allclose(phi, expected, rtol=1e-10, atol=1e-18)


def test_a_torque_drives_the_axial_motion_of_a_torsional_mode() -> None:
    phi = contact_modes(LONG, Structure()).frf([0.0])[0]
    mode = LONG.modes[1]
    assert phi[2, 3].real == pytest.approx(0.1 * 40.0 / mode.stiffness, rel=1e-12)
    assert phi[3, 3].real == pytest.approx(40.0**2 / mode.stiffness, rel=1e-12)
    assert phi[0, 3] == 0


@pytest.mark.parametrize(("depth", "share"), [(1e-9, 1.0), (0.01, 0.95), (0.02, (0.95 + 0.8) / 2)])
def test_lumped_over_the_depth_of_cut(depth: float, share: float) -> None:
    """The mean of the shape over the engaged height."""
    lumped = contact_modes(LONG, BAR).lumped(depth)
    assert lumped.shapes[0, 0] == pytest.approx(share / np.sqrt(1.2), rel=1e-6)
    assert lumped.shapes[0, 2] == pytest.approx(-1 / np.sqrt(5.0), rel=1e-12)


def test_one_contact_point_is_the_modal_model() -> None:
    model = contact_modes(Structure(BAR.modes), BAR)
    assert isinstance(model, ContactModes)
    np.testing.assert_array_equal(model.lumped(0.01).shapes, modal_model(Structure(BAR.modes), BAR).shapes)


def test_three_readings_of_a_cross_mode() -> None:
    """None: nothing; symmetric: the cross receptances alone; rank-one: the direct ones as well, all alike."""
    w, wn = 2 * np.pi * F, 2 * np.pi * 326.0
    gain = 1 / (34.1 * (wn**2 - w**2 + 2j * 0.0072 * wn * w))
    patterns = {"none": [[0, 0], [0, 0]], "symmetric": [[0, 1], [1, 0]], "rank-one": [[1, 1], [1, 1]]}
    for reading, pattern in patterns.items():
        tool = Structure(LONG.modes[:0], "tool", (), (CROSS,), reading)  # type: ignore[arg-type]
        added = frf(modal_model(tool, BAR), F) - frf(modal_model(Structure(), BAR), F)
        np.testing.assert_allclose(added[:, :2, :2], gain[:, None, None] * np.array(pattern), rtol=1e-6, atol=1e-16)
        assert tool.flexible == (reading != "none")


def test_a_symmetric_cross_mode_turns_with_the_frame() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    piece = Structure((), "machine", (), (dataclasses.replace(CROSS, plane="yz"),), "symmetric")
    found = frf(modal_model(Structure(), piece, turn), F)
    expected = frf(cross_frf_modes(326.0, 0.0072, 34.1, Y, (0, 0, 1)), F)
    np.testing.assert_allclose(found, turn.T @ expected @ turn, atol=1e-20, rtol=1e-9)


def two_modes(first: float, second: float) -> ModalModel:
    """Two modes in x with phases [rad]."""
    return modal_model(Structure((Mode(600.0, 0.05, 1.0, X, phase=first), Mode(700.0, 0.04, 1.5, X, phase=second))),
                       Structure())


def test_complex_residues_are_what_they_say() -> None:
    """The receptance is the sum of R / (s - lambda) and its conjugate with R = exp(i phase) u u^T / (2 i w_d)."""
    model = two_modes(0.1, -0.17)
    s, expected = 2j * np.pi * F, np.zeros(4, dtype=complex)
    for f, zeta, mass, phase in ((600.0, 0.05, 1.0, 0.1), (700.0, 0.04, 1.5, -0.17)):
        w = 2 * np.pi * f
        wd = w * np.sqrt(1 - zeta**2)
        pole, residue = -zeta * w + 1j * wd, np.exp(1j * phase) / (2j * wd * mass)
        expected += residue / (s - pole) + residue.conjugate() / (s - pole.conjugate())
    np.testing.assert_allclose(frf(model, F)[:, 0, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(state_space(model).frf(F)[:, 0, 0], expected, rtol=1e-9)


def test_complex_modes_that_cancel_are_accepted() -> None:
    """Two modes coupled by a damper between unlike masses: phases of both signs, no motion at once, power taken."""
    model = two_modes(0.05, -0.0877)
    found = checked_phases(model)
    system = state_space(found)
    assert np.abs(system.C @ system.B).max() < 1e-12 * np.abs(system.B).max()
    assert found.phase is not None
    np.testing.assert_allclose(found.phase, [0.05, -0.0877], atol=0.005)
    np.testing.assert_allclose(frf(found, F), frf(model, F), rtol=0.02)


@pytest.mark.parametrize(("phases", "words"), [((0.2, 0.0), "cannot move at once"), ((-0.6, 1.3), "would give power")])
def test_complex_modes_that_cannot_be_are_refused(phases: tuple[float, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        checked_phases(two_modes(*phases))


def test_real_modes_pass_unchanged() -> None:
    model = modal_model(LONG, BAR)
    assert checked_phases(model) is model
    assert join(model, two_modes(0.1, -0.17)).phase is not None


@pytest.mark.parametrize(("change", "words"), [
    ({"heights": (0.0,)}, "ascending"), ({"heights": (0.0, 0.02, 0.01)}, "ascending"), ({"heights": ()}, "one shape"),
    ({"heights": (-0.01, 0.0, 0.1)}, "height"), ({"frame": "rotating"}, "rotating frame"),
    ({"cross_reading": "both"}, "cross reading"), ({"frame": "workpiece"}, "frame"),
])
def test_impossible_structures_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(LONG, **change)


@pytest.mark.parametrize(("change", "words"), [
    ({"damping": -0.01}, "damping"), ({"damping": 1.0}, "damping"), ({"frequency": np.nan}, "frequency"),
    ({"mass": 0.0}, "mass"), ({"shape": (0.0, 0.0, 0.0)}, "shape"), ({"shape": (np.inf, 0.0, 0.0)}, "shape"),
    ({"phase": 2.0}, "phase"), ({"torsion": np.nan}, "torsion"),
])
def test_impossible_modes_are_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(BAR.modes[0], **change)


def test_turning_modes_have_no_fixed_shape() -> None:
    with pytest.raises(ValueError, match="no fixed shape"):
        modal_model(Structure(BAR.modes, "rotating"), Structure())
