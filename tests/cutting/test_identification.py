"""Identification: recovers injected coefficients, covers the truth as often as it says, refuses bad tables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.cutting.cases import AL6061, MM, milling
from turnmill_core.cutting.forces import revolution
from turnmill_core.cutting.identification import AverageForces, identify
from turnmill_core.operation import Shape, Tool

TOOL = Tool("t", 20 * MM, 4, math.radians(30))
TRUTH = np.array([AL6061.Ktc, AL6061.Krc, AL6061.Kac, AL6061.Kte, AL6061.Kre, AL6061.Kae])
FEEDS = np.array([0.05, 0.08, 0.11, 0.14, 0.17, 0.2]) * MM


def measured(spans_mm: list[tuple[float, float]], tool: Tool = TOOL) -> AverageForces:
    """Average forces of the force model, by its time steps, for every feed and engagement."""
    rows = []
    for low, high in spans_mm:
        for feed in FEEDS:
            op = milling(tool, AL6061, 2 * MM, feed, (low * MM, high * MM))
            mean = revolution(op, op.conditions, 1440, 40, average=True).force_tool.mean(axis=0)
            rows.append((feed, 2 * MM, math.acos(high / 10), math.acos(low / 10), mean))
    feed, depth, start, stop, force = (np.array(column) for column in zip(*rows, strict=True))
    return AverageForces(feed, depth, start, stop, force)


@pytest.mark.parametrize("spans", [[(-10, 10)], [(0, 10)], [(-10, -5)], [(-10, 10), (3, 10)]])
def test_recovers_what_the_force_model_was_given(spans: list[tuple[float, float]]) -> None:
    found = identify(TOOL, measured(spans))
    assert found.value == pytest.approx(TRUTH, rel=2e-4)
    assert np.abs(found.residual).max() < 0.02


def test_pitch_and_helix_do_not_matter_but_the_edge_length() -> None:
    tool = Tool("t", 20 * MM, 4, math.radians(45), pitch_angles=(1.4, 1.7, 1.5, 2 * math.pi - 4.6))
    assert identify(tool, measured([(0, 10)], tool)).value == pytest.approx(TRUTH, rel=2e-4)


def test_interval_covers_the_truth_in_95_percent_of_trials() -> None:
    clean = measured([(2, 10)])
    rng = np.random.default_rng(20260726)
    trials = 2000
    inside = np.zeros(6)
    for _ in range(trials):
        noisy = AverageForces(clean.feed_per_tooth, clean.depth, clean.start, clean.exit,
                              clean.force + rng.normal(0, [3.0, 3.0, 1.5], clean.force.shape))
        found = identify(TOOL, noisy)
        inside += (found.lower <= TRUTH) & (found.upper >= TRUTH)
    assert inside / trials == pytest.approx(np.full(6, 0.95), abs=0.02)


def test_scatter_is_that_of_the_measurement() -> None:
    clean = measured([(-10, 10), (0, 10), (-10, 0), (3, 10)])
    rng = np.random.default_rng(7)
    noise = rng.normal(0, [4.0, 4.0, 1.0], clean.force.shape)
    noisy = AverageForces(clean.feed_per_tooth, clean.depth, clean.start, clean.exit, clean.force + noise)
    found = identify(TOOL, noisy)
    assert found.scatter == pytest.approx([4, 1], rel=0.3)
    assert np.std(found.residual[:, :2]) < 4.5


def test_scalar_columns_are_spread() -> None:
    tests = AverageForces(FEEDS, np.asarray(2 * MM), np.asarray(0.0), np.asarray(math.pi), np.ones((6, 3)))
    assert tests.depth.shape == (6,)


@pytest.mark.parametrize(("change", "message"), [
    ({"force": np.ones((6, 2))}, r"force is \(6, 2\)"), ({"depth": np.full(6, -1.0)}, "depth is"),
    ({"exit": np.zeros(6)}, "exit is"), ({"start": np.full(6, np.nan)}, "start is.*finite")])
def test_bad_tables(change: dict[str, np.ndarray], message: str) -> None:
    good = {"feed_per_tooth": FEEDS, "depth": np.full(6, 2 * MM), "start": np.zeros(6), "exit": np.full(6, 3.0),
            "force": np.ones((6, 3))}
    with pytest.raises(ValueError, match=message):
        AverageForces(**{**good, **change})


def test_one_feed_or_two_tests_are_not_enough() -> None:
    same = AverageForces(np.full(6, 1e-4), np.full(6, 2 * MM), np.zeros(6), np.full(6, 3.0), np.ones((6, 3)))
    with pytest.raises(ValueError, match="different feeds"):
        identify(TOOL, same)
    two = AverageForces(FEEDS[:2], np.full(2, 2 * MM), np.zeros(2), np.full(2, 3.0), np.ones((2, 3)))
    with pytest.raises(ValueError, match="number of tests is 2"):
        identify(TOOL, two)
    with pytest.raises(ValueError, match="confidence is 1"):
        identify(TOOL, same, 1.0)


def test_only_cylinders_have_this_closed_form() -> None:
    ball = Tool("ball", 20 * MM, 4, shape=Shape(corner_radius=10 * MM))
    with pytest.raises(ValueError, match="a cylinder"):
        identify(ball, measured([(0, 10)]))
