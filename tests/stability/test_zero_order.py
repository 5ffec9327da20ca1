"""Zero-order limits where they are exact, and in both frames."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stability.cases import textbook
from turnmill_core.operation import Mode
from turnmill_core.stability.collocation import leading_multiplier
from turnmill_core.stability.zero_order import zero_order_limit
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
