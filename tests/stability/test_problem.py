"""Directional matrices and the values that describe a problem."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stability.cases import textbook
from turnmill_core.stability.problem import (
    Engagement,
    StabilityProblem,
    constant_engagement,
    contact_basis,
    directional_matrix,
    kink_angles,
    mean_directional_matrices,
)
from turnmill_core.structure.modal import LinearStructure

COEFFICIENTS = (930e6, 290e6, 242e6)


def by_slices(problem: StabilityProblem, tip: float, slices: int = 20000) -> np.ndarray:
    """The integral over the height by the midpoint rule, force law written out."""
    Ktc, Krc, Kac = problem.coefficients
    e = problem.engagement
    z = (np.arange(slices) + 0.5) * e.depth / slices
    phi = tip - problem.helix_lag * z
    out = np.zeros((3, 2))
    for arc in range(e.start.shape[1]):
        start, stop = (np.interp(z, e.height, angle[:, arc]) for angle in (e.start, e.exit))
        cut = np.mod(phi - start, 2 * np.pi) <= stop - start
        s, c = np.sin(phi), np.cos(phi)
        force = np.array([-Krc * s - Ktc * c, -Krc * c + Ktc * s, -Kac * np.ones_like(s)])
        out += (force * cut) @ np.column_stack([s, c]) * e.depth / slices
    return out


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 6.28), st.floats(-400, 800), st.floats(-1.0, 2.0), st.floats(0.2, 3.0), st.floats(0.0, 0.4))
def test_directional_matrix_is_the_integral_over_the_height(
    tip: float, lag: float, start: float, width: float, taper: float,
) -> None:
    height = np.array([0.0, 0.7e-3, 2e-3])
    two_arcs = np.column_stack([np.full(3, start), np.full(3, start + width + 0.2)])
    exits = two_arcs + np.column_stack([width - taper * np.array([0, 0.2, 0.5]) * width, np.array([0.3, 0.1, 0.0])])
    problem = textbook(1e-3).at(
        engagement=Engagement(height, two_arcs, exits), helix_lag=lag, coefficients=COEFFICIENTS)
    np.testing.assert_allclose(
        directional_matrix(problem, [tip])[0], by_slices(problem, tip), atol=930e6 * 2e-3 * 4e-4)


def test_one_tooth_without_helix_has_a_rank_one_matrix() -> None:
    problem = textbook(1e-3).at(coefficients=COEFFICIENTS)
    G = directional_matrix(problem, [1.1])[0]
    assert np.linalg.matrix_rank(G) == 1
    np.testing.assert_allclose(G @ [np.cos(1.1), -np.sin(1.1)], 0, atol=1e-6)  # along the edge: no chip


def test_outside_the_cut_there_is_no_force() -> None:
    problem = textbook(1e-3, start=0.0, exit=1.0)
    assert not np.any(directional_matrix(problem, [1.01, 3.0, 6.27]))


def test_mean_matrices_add_up_to_the_integral() -> None:
    problem = textbook(2e-3, start=0.3, exit=1.7, lag=300.0)
    fine = mean_directional_matrices(problem, np.linspace(0, 2 * np.pi, 4001)).mean(axis=0)
    coarse = mean_directional_matrices(problem, np.linspace(0, 2 * np.pi, 8)).mean(axis=0)
    np.testing.assert_allclose(coarse, fine, rtol=1e-4)
    # the closed form of the average: helix only delays, so it drops out
    c2, s2 = np.sin(3.4) / 2 - np.sin(0.6) / 2, -np.cos(3.4) / 2 + np.cos(0.6) / 2
    Ktc, Krc, _ = problem.coefficients
    average = -0.5 * 2e-3 / (2 * np.pi) * (Krc * (1.4 - c2) + Ktc * s2)
    assert coarse[0, 0] == pytest.approx(average, rel=1e-4)


def test_kinks_are_where_the_edge_enters_and_leaves() -> None:
    angles = kink_angles(textbook(2e-3, start=0.3, exit=1.7, lag=300.0))
    np.testing.assert_allclose(angles, [0.3, 0.9, 1.7, 2.3])


def test_contact_basis_has_as_many_columns_as_directions_that_move() -> None:
    assert contact_basis(textbook(1e-3, axes=1).structure).shape == (2, 1)
    assert contact_basis(textbook(1e-3, axes=2).structure).shape == (2, 2)
    stiff = LinearStructure([[0.0, 1.0], [-1.0, -0.1]], [[0, 0, 0], [0, 0, 1.0]], [[0, 0], [0, 0], [1.0, 0]])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="across its axis"):
        contact_basis(stiff)


def test_principal_period() -> None:
    problem = textbook(1e-3, teeth=4)
    assert problem.period == pytest.approx(problem.delays[0])
    pitch = (1.4, 1.7, 1.4, 2 * np.pi - 4.5)
    variable = problem.at(pitch=pitch, delays=tuple(p / problem.tool_speed for p in pitch))
    assert variable.period == pytest.approx(2 * np.pi / problem.tool_speed)


@pytest.mark.parametrize(("change", "message"), [
    ({"tool_speed": 0.0}, "tool speed"), ({"tool_speed": np.inf}, "tool speed"), ({"delays": (1e-3,)}, "delays"),
    ({"delays": (1e-3, np.nan)}, "delays"), ({"pitch": (3.0, 3.0)}, "pitch"), ({"delay_variation": 1.0}, "variation"),
    ({"helix_lag": np.nan}, "finite"), ({"coefficients": (1e9, np.nan, 0.0)}, "finite"),
])
def test_impossible_problems_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        textbook(1e-3).at(**change)


@pytest.mark.parametrize(("depth", "start", "stop", "message"), [
    (0.0, 0.0, 1.0, "height"), (1e-3, 1.0, 0.5, "out of order"), (1e-3, 0.5, 0.5, "zero"),
    (1e-3, 0.0, np.nan, "finite"),
])
def test_impossible_engagement_is_refused(depth: float, start: float, stop: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        constant_engagement(depth, start, stop)
