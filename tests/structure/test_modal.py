"""Modal model of tool and workpiece against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.operation import RIGID, Mode, Structure
from turnmill_core.structure.modal import ModalModel, cross_frf_modes, frf, join, modal_model, state_space

TOOL = Structure((Mode(682.0, 0.0532, 1.303, (1, 0, 0)), Mode(776.0, 0.032, 0.873, (0, 1, 0))))
BAR = Structure((Mode(332.0, 0.0184, 4.94, (1, 0, 0)), Mode(1100.0, 0.01, 0.5, (0.6, 0.8, 0.1))), "tool")


def turn(x: float, y: float, z: float) -> np.ndarray:
    """Rotation matrix from three angles [rad]."""
    def about(axis: int, angle: float) -> np.ndarray:
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        r = np.eye(3)
        r[[i, j], [i, j]] = np.cos(angle)
        r[i, j], r[j, i] = -np.sin(angle), np.sin(angle)
        return r
    return about(0, x) @ about(1, y) @ about(2, z)


def test_static_receptance_is_the_sum_of_the_compliances() -> None:
    phi = frf(modal_model(TOOL, BAR), [0.0])[0]
    expected = np.zeros((3, 3))
    for mode in (*TOOL.modes, *BAR.modes):
        expected += np.outer(mode.shape, mode.shape) / mode.stiffness
    np.testing.assert_allclose(phi, expected, rtol=1e-12)


def test_receptance_of_one_mode_at_its_natural_frequency() -> None:
    mode = TOOL.modes[0]
    phi = frf(modal_model(Structure((mode,)), RIGID), [mode.frequency])[0, 0, 0]
    assert phi == pytest.approx(-1j / (2 * mode.damping * mode.stiffness), rel=1e-12)


def test_state_space_has_the_same_receptance() -> None:
    model = modal_model(TOOL, BAR)
    system = state_space(model)
    f = np.array([100.0, 331.0, 700.0, 1099.0])
    for phi, w in zip(frf(model, f), 2 * np.pi * f, strict=True):
        np.testing.assert_allclose(
            system.C @ np.linalg.solve(1j * w * np.eye(system.size) - system.A, system.B), phi, rtol=1e-9, atol=1e-15)


def test_the_workpiece_moves_against_the_tool() -> None:
    soft_bar = modal_model(RIGID, Structure((BAR.modes[0],), "tool"))
    assert soft_bar.shapes[0, 0] == pytest.approx(-1 / np.sqrt(4.94))
    assert frf(soft_bar, [0.0])[0, 0, 0].real > 0


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_turning_the_frame_turns_the_receptance(angles: tuple[float, float, float]) -> None:
    machine_from_tool = turn(*angles)
    structures = Structure(TOOL.modes, "machine"), Structure(BAR.modes, "machine")
    in_tool = frf(modal_model(*structures, machine_from_tool), [500.0])[0]
    in_machine = frf(modal_model(TOOL, BAR), [500.0])[0]
    np.testing.assert_allclose(machine_from_tool @ in_tool @ machine_from_tool.T, in_machine, atol=1e-18, rtol=1e-9)


def test_only_modes_of_the_machine_frame_are_turned() -> None:
    model = modal_model(TOOL, Structure(BAR.modes, "machine"), turn(0.0, 0.0, np.pi / 2))
    np.testing.assert_allclose(model.shapes[:, 0], [1 / np.sqrt(1.303), 0, 0])
    np.testing.assert_allclose(model.shapes[:, 2], [0, 1 / np.sqrt(4.94), 0], atol=1e-15)


def test_a_cross_mode_adds_to_the_cross_receptances_only() -> None:
    cross = cross_frf_modes(326.0, 0.0072, 34.1, (1, 0, 0), (0, 1, 0))
    w, wn = 2 * np.pi * 300.0, 2 * np.pi * 326.0
    expected = 1 / (34.1 * (wn**2 - w**2 + 2j * 0.0072 * wn * w))
    phi = frf(cross, [300.0])[0]
    np.testing.assert_allclose(phi, expected * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]]), rtol=1e-12)
    both = frf(join(modal_model(TOOL, BAR), cross), [300.0])[0]
    np.testing.assert_allclose(both - frf(modal_model(TOOL, BAR), [300.0])[0], phi, atol=1e-18)


@pytest.mark.parametrize(("change", "message"), [
    ({"frequency": [-1.0]}, "frequency"), ({"damping": [-0.01]}, "damping"), ({"damping": [1.0]}, "damping"),
    ({"frequency": [np.nan]}, "not finite"), ({"shapes": [[np.inf], [0], [0]]}, "not finite"),
    ({"shapes": [[1.0], [0.0]]}, "shape"),
])
def test_impossible_modes_are_refused(change: dict[str, object], message: str) -> None:
    good = {"frequency": [900.0], "damping": [0.01], "shapes": [[1.0], [0], [0]], "force_shapes": [[1.0], [0], [0]]}
    with pytest.raises(ValueError, match=message):
        ModalModel(**{**good, **change})  # type: ignore[arg-type]


def test_a_matrix_that_is_no_rotation_is_refused() -> None:
    with pytest.raises(ValueError, match="rotation"):
        modal_model(TOOL, BAR, np.diag([1.0, 1.0, -1.0]))


def test_values_cannot_be_changed() -> None:
    model = modal_model(TOOL, BAR)
    with pytest.raises(ValueError, match="read-only"):
        model.shapes[0, 0] = 0.0
