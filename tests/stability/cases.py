"""Problems that several stability tests share."""

from __future__ import annotations

import numpy as np

from turnmill_core.operation import RIGID, Mode, Structure
from turnmill_core.stability.problem import StabilityProblem, constant_engagement
from turnmill_core.structure.modal import modal_model, state_space

TEXTBOOK = Mode(922.0, 0.011, 0.03993, (1, 0, 0))
PUBLISHED = {0.2e-3: 0.81974278, 0.5e-3: 1.07397559, 1.0e-3: 1.40647353}


def textbook(
    depth: float, rpm: float = 5000.0, start: float = 0.0, exit: float = np.pi, axes: int = 1, teeth: int = 2,
    lag: float = 0.0, shift: float = 0.0, process_damping: tuple[float, float] = (0.0, 0.0),
) -> StabilityProblem:
    """Milling benchmark of Insperger and Stepan; axes 1: mode along x, 2: also y; shift: delay / tooth period - 1."""
    modes = (TEXTBOOK, Mode(922.0, 0.011, 0.03993, (0, 1, 0)))[:axes]
    speed = rpm * np.pi / 30
    pitch = 2 * np.pi / teeth
    return StabilityProblem(
        state_space(modal_model(Structure(modes), RIGID)), speed, (pitch,) * teeth,
        (pitch / speed * (1 + shift),) * teeth, lag, (600e6, 200e6, 0.0), constant_engagement(depth, start, exit),
        process_damping=process_damping)
