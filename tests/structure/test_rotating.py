"""Modes in the tool's frame against the fixed frame and against energy."""

from __future__ import annotations

import numpy as np
import pytest

from turnmill_core.operation import RIGID, Mode, Structure
from turnmill_core.stability.problem import frame_matrix
from turnmill_core.structure.modal import modal_model, state_space
from turnmill_core.structure.rotating import rotating_structure

U, V = Mode(2283.0, 0.04, 0.02, (1, 0, 0)), Mode(3207.0, 0.03, 0.01, (0, 1, 0))
SPEED = 1700.0


def test_at_standstill_the_frames_coincide() -> None:
    still = rotating_structure(U, V, 0.0)
    fixed = state_space(modal_model(Structure((U, V)), RIGID))
    np.testing.assert_allclose(still.A, fixed.A)
    poles = [np.sort_complex(np.linalg.eigvals(s.A)) for s in (still, fixed)]
    np.testing.assert_allclose(*poles)
    for w in (0.0, 1e4):
        responses = [s.C @ np.linalg.solve(1j * w * np.eye(4) - s.A, s.B) for s in (still, fixed)]
        np.testing.assert_allclose(*responses, atol=1e-18)


def test_free_vibration_of_a_symmetric_tool_seen_from_both_frames() -> None:
    """d_fixed(t) = T(Omega t) q(t) when the damping is fixed in the machine."""
    from scipy.linalg import expm
    mode = Mode(2000.0, 0.03, 0.02, (1, 0, 0))
    fixed = state_space(modal_model(Structure((mode, Mode(2000.0, 0.03, 0.02, (0, 1, 0)))), RIGID))
    rotating = rotating_structure(mode, mode, SPEED, "printed", "machine")
    q, dq = np.array([1e-6, 2e-6]), np.array([0.01, -0.02])
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])
    start = np.concatenate([q, dq + SPEED * J @ q]) * np.sqrt(0.02)  # modal coordinates of the fixed frame
    for t in (1e-4, 7e-4, 3e-3):
        turning = rotating.C[:2] @ expm(rotating.A * t) @ np.concatenate([q, dq])
        seen = fixed.C[:2] @ expm(fixed.A * t) @ start
        np.testing.assert_allclose(frame_matrix(SPEED * t)[0] @ turning, seen, atol=1e-15)


@pytest.mark.parametrize(("form", "works"), [("skew-symmetric", False), ("printed", True)])
def test_the_printed_coriolis_force_does_work(form: str, works: bool) -> None:
    """Erratum D7: with unlike masses the printed coupling is not skew-symmetric."""
    s = rotating_structure(U, V, SPEED, form)  # type: ignore[arg-type]
    bare = rotating_structure(U, V, 0.0)
    force = np.diag([U.mass, V.mass]) @ (s.A - bare.A)[2:, 2:]
    assert (abs(np.array([1.0, 2.0]) @ force @ [1.0, 2.0]) > 1e-6) == works


@pytest.mark.parametrize("names", [("wrong", "tool"), ("printed", "somewhere")])
def test_unknown_names_are_refused(names: tuple[str, str]) -> None:
    with pytest.raises(ValueError, match="expected"):
        rotating_structure(U, V, SPEED, *names)  # type: ignore[arg-type]
