"""Sampled depth limits."""

from __future__ import annotations

import numpy as np
import pytest

from turnmill_core.machine.conditions import with_cut
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.stability.margin import stability_margin
from turnmill_core.stability.uncertainty import Spread, limit_distribution


@pytest.fixture(scope="module")
def milling() -> Operation:
    """The one-degree-of-freedom benchmark."""
    return read_operation(shipped_operations()["milling_benchmark_1dof"])


def test_without_spread_every_sample_is_the_limit(milling: Operation) -> None:
    found = limit_distribution(milling, milling.conditions, Spread(0.0, 0.0, 0.0, 0.0), samples=3)
    exact = stability_margin(milling, milling.conditions).depth_limit
    np.testing.assert_allclose(found.limits, exact, rtol=2e-3)
    assert found.probability_stable == 1.0


def test_coefficients_alone_scale_the_limit(milling: Operation) -> None:
    """The limit of a single mode goes with 1 / coefficient: its spread is about that of the coefficients."""
    found = limit_distribution(milling, milling.conditions, Spread(0.0, 0.0, 0.0, 0.1), samples=40, seed=3)
    assert 0.05 < np.std(np.log(found.limits)) < 0.2


def test_equal_seeds_give_equal_limits_and_quantiles_are_ordered(milling: Operation) -> None:
    cut = with_cut(milling, depth=0.4e-3)
    first, second = (limit_distribution(milling, cut, samples=12, seed=7) for _ in range(2))
    np.testing.assert_array_equal(first.limits, second.limits)
    assert first.quantile(0.05) <= first.quantile(0.5) <= first.quantile(0.95)
    assert 0 < first.probability_stable < 1


def test_impossible_spreads_are_refused(milling: Operation) -> None:
    with pytest.raises(ValueError, match="damping"):
        Spread(damping=-0.1)
    with pytest.raises(ValueError, match="samples"):
        limit_distribution(milling, milling.conditions, samples=0)
