"""Zero-order limits where they are exact, and in both frames."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stability.cases import textbook
from turnmill_core.operation import Mode
from turnmill_core.prediction import PredictedType
from turnmill_core.stability import collocation
from turnmill_core.stability.collocation import leading_multiplier
from turnmill_core.stability.zero_order import solve, zero_order_limit
from turnmill_core.structure.rotating import rotating_structure


@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize("rpm", [4000.0, 9000.0])
def test_exact_where_the_directional_matrix_is_constant(axes: int, rpm: float) -> None:
    """Four straight teeth in a slot."""
    limit = zero_order_limit(textbook(1e-4, rpm=rpm, teeth=4, axes=axes))
    at_limit = leading_multiplier(textbook(limit.depth, rpm=rpm, teeth=4, axes=axes), 4.0)
    assert abs(at_limit) == pytest.approx(1.0, abs=1e-5)


def test_near_the_truth_at_half_immersion() -> None:
    limit = zero_order_limit(textbook(1e-4, rpm=9000, axes=2, exit=np.pi / 2))
    assert abs(leading_multiplier(textbook(0.8 * limit.depth, rpm=9000, axes=2, exit=np.pi / 2))) < 1
    assert abs(leading_multiplier(textbook(1.5 * limit.depth, rpm=9000, axes=2, exit=np.pi / 2))) > 1


def test_a_symmetric_tool_has_the_same_limit_in_both_frames() -> None:
    """Erratum D10: B = A R(pitch) for any number of teeth; the frequency moves by the spindle's."""
    fixed = textbook(1e-4, rpm=9000, teeth=4, axes=2)
    mode = Mode(922.0, 0.011, 0.03993, (1, 0, 0))
    rotating = fixed.at(structure=rotating_structure(mode, mode, fixed.tool_speed, "printed", "machine"), rotating=True)
    one, two = zero_order_limit(fixed), zero_order_limit(rotating)
    assert two.depth == pytest.approx(one.depth, rel=1e-6)
    assert abs(two.frequency - one.frequency) == pytest.approx(150.0, abs=0.01)


def test_delays_that_differ_are_refused() -> None:
    problem = textbook(1e-4)
    with pytest.raises(ValueError, match="delay"):
        zero_order_limit(problem.at(delays=(problem.delays[0], 1.1 * problem.delays[0])))


@pytest.mark.parametrize("damping", [(0.0, 0.0), (2e4, 0.3)])
@pytest.mark.parametrize("depth", [0.1e-3, 0.4e-3])
def test_the_verdict_is_exact_where_the_matrix_is_constant(depth: float, damping: tuple[float, float]) -> None:
    """Four straight teeth in a slot: the same multipliers and frequencies as the fast solver."""
    problem = textbook(depth, rpm=6000, teeth=4, axes=2, process_damping=damping)
    zero, fast = solve(problem), collocation.solve(problem, 3.1e-6)
    assert zero.spectral_radius == pytest.approx(fast.spectral_radius, abs=2e-6)
    assert zero.predicted_type is fast.predicted_type
    assert zero.lines[0].frequency == pytest.approx(fast.lines[0].frequency, abs=0.01)


@pytest.mark.parametrize("change", [{}, {"exit": np.pi / 2}, {"exit": 1.2, "shift": 0.05}])
def test_the_verdict_turns_at_the_limit(change: dict[str, float]) -> None:
    problem = textbook(1e-4, rpm=9000, axes=2, **change)  # type: ignore[arg-type]
    limit = zero_order_limit(problem)
    low, at, high = (solve(textbook(f * limit.depth, rpm=9000, axes=2, **change)) for f in (0.99, 1.0, 1.01))  # type: ignore[arg-type]
    assert at.spectral_radius == pytest.approx(1.0, abs=1e-7)
    assert at.lines[0].frequency == pytest.approx(limit.frequency, abs=0.01)
    assert (low.predicted_type, high.predicted_type) == (PredictedType.STABLE, PredictedType.HOPF)


def test_the_verdict_is_the_same_in_both_frames() -> None:
    fixed = textbook(0.2e-3, rpm=9000, teeth=3, axes=2)
    mode = Mode(922.0, 0.011, 0.03993, (1, 0, 0))
    rotating = fixed.at(structure=rotating_structure(mode, mode, fixed.tool_speed, "printed", "machine"), rotating=True)
    one, two = solve(fixed), solve(rotating)
    assert two.spectral_radius == pytest.approx(one.spectral_radius**3, rel=1e-7)
    assert two.lines[0].frequency == pytest.approx(one.lines[0].frequency, abs=0.01)


def test_process_damping_has_no_limit_but_a_verdict() -> None:
    with pytest.raises(ValueError, match="process damping"):
        zero_order_limit(textbook(1e-4, process_damping=(1e4, 0.3)))
    bare, damped = (solve(textbook(0.4e-3, process_damping=d)).spectral_radius for d in ((0.0, 0.0), (1e4, 0.3)))
    assert damped < bare
