"""Seeded random stability problems: 1 to 12 modes, 1 to 6 teeth, helix, delays, pitch, engagement, damping."""

from __future__ import annotations

import numpy as np

from turnmill_core.operation import Mode, Structure
from turnmill_core.stability.problem import Engagement, StabilityProblem, constant_engagement
from turnmill_core.structure.modal import modal_model, state_space


def random_problem(seed: int) -> StabilityProblem:
    """Problem number `seed`; its depth lies around the stability limit of its most flexible mode."""
    rng = np.random.default_rng(seed)
    modes = []
    for _ in range(rng.integers(1, 13)):
        shape = rng.standard_normal(3) * [1, 1, 0.3] if rng.random() < 0.4 else np.eye(3)[rng.integers(0, 2)]
        frequency = 10 ** rng.uniform(2.4, 3.3)
        stiffness = 10 ** rng.uniform(6.3, 7.8)
        mass = stiffness / (2 * np.pi * frequency) ** 2
        modes.append(Mode(frequency, 10 ** rng.uniform(-2.2, -1.2), mass, tuple(shape)))
    split = int(rng.integers(0, len(modes) + 1))
    structure = state_space(modal_model(Structure(tuple(modes[:split])), Structure(tuple(modes[split:]), "tool")))
    teeth = int(rng.integers(1, 7))
    lowest = min(m.frequency for m in modes)
    speed = 2 * np.pi * lowest / teeth / rng.uniform(0.7, 6.0)
    pitch = np.full(teeth, 2 * np.pi / teeth)
    if teeth > 1 and rng.random() < 0.3:
        pitch += pitch * rng.uniform(-0.12, 0.12, teeth)
        pitch *= 2 * np.pi / pitch.sum()
    stretch = 1 + rng.choice([0.0, 0.002, 0.05, 0.4]) * rng.uniform(0.5, 1)
    lag = rng.choice([0.0, 1.0]) * rng.uniform(20, 120)
    coefficients = (10 ** rng.uniform(8.7, 9.3), 0.0, 0.0)
    coefficients = (coefficients[0], coefficients[0] * rng.uniform(0.1, 0.7), coefficients[0] * rng.uniform(0, 0.3))
    start = float(rng.choice([0.0, rng.uniform(0, 2)]))
    stop = start + rng.uniform(0.3, np.pi - start)
    soft = min(m.stiffness * 2 * m.damping / max(np.dot(m.shape[:2], m.shape[:2]), 1e-3) for m in modes)
    share = max(1.0, teeth * (stop - start) / (2 * np.pi))
    depth = soft / coefficients[0] / share * 10 ** rng.uniform(-0.3, 0.6)
    engagement = constant_engagement(depth, start, stop)
    if rng.random() < 0.3:
        height = depth * (1 - (1 - np.linspace(0, 1, 17)) ** 2)
        taper = np.sqrt(1 - height / depth * 0.999)
        engagement = Engagement(height, np.full(17, start), start + (stop - start) * taper)
    return StabilityProblem(
        structure, speed, tuple(pitch), tuple(pitch / speed * stretch), float(lag), coefficients, engagement,
        delay_variation=float(rng.choice([0.0, 0.0, 0.0, rng.uniform(0.005, 0.05)])))
