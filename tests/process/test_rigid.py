"""With a stiff structure the simulated forces are the static cutting forces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.process.cases import STIFF, exact_config, milling, run, turn_milling
from turnmill_core.cutting.forces import revolution
from turnmill_core.operation import Material, Mode, Operation, SchedulePoint

EDGES = Material("aluminium", 700e6, 250e6, 90e6, 21e3, 25e3, 8e3)
FORCES = ("force_x", "force_y", "force_z")
VERY_STIFF = tuple(Mode(20e3, 0.7, 1e6, mode.shape) for mode in STIFF)
CASES = {
    "slot": milling(VERY_STIFF, material=EDGES, depth=1e-3),
    "up-milling, helix": milling(VERY_STIFF, material=EDGES, depth=4e-3, span=(2e-3, 5e-3),
                                 helix_angle=math.radians(30)),
    "down-milling, 4 teeth": milling(VERY_STIFF, material=EDGES, depth=1e-3, span=(-5e-3, -2e-3), teeth=4),
    "turn-milling, up": turn_milling(VERY_STIFF, material=EDGES, depth=2e-3),
    "turn-milling, down, helix": turn_milling(VERY_STIFF, material=EDGES, depth=3e-3, sense="down", axial_feed=6e-3,
                                              helix_angle=math.radians(25)),
    "turn-milling, small tool": turn_milling(VERY_STIFF, material=EDGES, depth=5e-3, axial_feed=3e-3, teeth=4),
    "runout": milling(VERY_STIFF, material=EDGES, depth=1e-3, teeth=3, runout=(2e-5, 0.0, -1e-5)),
    "runout beyond the feed": milling(VERY_STIFF, material=EDGES, depth=1e-3, teeth=3, runout=(2.5e-4, 0.0, -1e-5)),
    "variable pitch": milling(VERY_STIFF, material=EDGES, depth=1e-3, pitch_angles=(math.pi - 0.3, math.pi + 0.3)),
}


def last_turn(op: Operation, turns: int = 6, per_turn: int = 3600) -> np.ndarray:
    """Forces (per_turn, 3) over the last of `turns` tool revolutions, from a multiple of a turn on."""
    period = 2 * math.pi / op.conditions.tool_speed
    rate = round(per_turn / period)
    config = exact_config(rate, FORCES, block_duration=period, slices=96 if op.tool.helix_angle else 1)
    found = run(op, config, turns * period + 1e-6)
    first = round((turns - 1) * period * rate)
    return found[first : first + round(period * rate)]


@pytest.mark.parametrize("name", CASES)
def test_forces_are_those_of_the_static_cut(name: str) -> None:
    """Mean within 0.5 %, rms of the difference within 1.5 % of the peak (the edges of the cut are steps)."""
    op = CASES[name]
    found = last_turn(op)
    expected = revolution(op, op.conditions, angles=len(found), elements=128).force_tool
    peak = np.abs(expected).max()
    mean = expected.mean(axis=0)
    np.testing.assert_allclose(found.mean(axis=0), mean, atol=0.005 * np.abs(mean).max())
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.015 * peak
    np.testing.assert_allclose(np.abs(found).max(axis=0), np.abs(expected).max(axis=0), rtol=0.02)


def test_slotting_forces_in_closed_form() -> None:
    """Full immersion, two straight teeth: from the integral of Eq. 4.66 by hand.

    With one tooth in the cut at any time, h = f sin(phi) over half a turn: mean Fy = a Ktc f / 2,
    mean Fx = -a Krc f / 2, peak Fz = -a Kac f.
    """
    op = milling(VERY_STIFF, material=Material("no edges", 700e6, 250e6, 90e6), depth=1e-3)
    found = last_turn(op)
    a, f = 1e-3, op.feed_per_tooth
    assert found[:, 0].mean() == pytest.approx(-a * 250e6 * f / 2, rel=2e-3)
    assert found[:, 1].mean() == pytest.approx(a * 700e6 * f / 2, rel=2e-3)
    assert found[:, 2].min() == pytest.approx(-a * 90e6 * f, rel=2e-3)


def test_no_force_in_the_air() -> None:
    op = milling(VERY_STIFF, depth=-1e-4)
    assert np.all(run(op, exact_config(50_000, FORCES), 0.05) == 0)


def test_a_still_spindle_cuts_nothing() -> None:
    op = milling(depth=1e-3)
    still = replace(op, schedule=(SchedulePoint(0.0, 0.0, 0.0, 1e-3), SchedulePoint(0.05, 0.0, 0.0, 1e-3)))
    assert np.all(run(still, exact_config(50_000, FORCES), 0.05) == 0)
