"""Every compiled loop against its plain version: the same function uncompiled, numpy, or a quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from tests.stability.random_problems import random_problem
from turnmill_core.stability._kernels import cut, operators, spectrum
from turnmill_core.stability.collocation import modal_blocks, period_map, tables
from turnmill_core.stability.problem import directional_matrix


def cut_arguments(seed: int) -> tuple[object, ...]:
    p = random_problem(seed)
    e = p.engagement
    return p.tooth_angles, float(p.helix_lag), np.array(e.height), np.array(e.start), np.array(e.exit)


@pytest.mark.parametrize("seed", range(12))
def test_tooth_matrix_is_the_directional_matrix(seed: int) -> None:
    p = random_problem(seed)
    _, lag, *engagement = cut_arguments(seed)
    for tip in np.linspace(0, 2 * np.pi, 37):
        out = np.zeros((3, 2))
        cut.tooth_matrix(tip, lag, *engagement, *p.coefficients, out)
        expected = directional_matrix(p, [tip])[0]
        np.testing.assert_allclose(out, expected, rtol=1e-9, atol=1e-12 * p.coefficients[0] * p.engagement.depth)


@pytest.mark.parametrize("seed", range(6))
def test_layout_and_channels_are_their_plain_selves(seed: int) -> None:
    p = random_problem(seed)
    arguments = cut_arguments(seed)
    period = p.tool_speed * p.period
    delays = p.tool_speed * np.array(p.delays)
    for shift in (0.0, 0.3):
        np.testing.assert_array_equal(cut.break_angles(period, *arguments, shift),
                                      cut.break_angles.py_func(period, *arguments, shift))
    layout = [f(period, *arguments, 0.0, 0.01, 5.0, 1.0, 2.0) for f in (cut.layout, cut.layout.py_func)]
    for a, b in zip(*layout, strict=True):
        np.testing.assert_array_equal(a, b)
    edges, nodes, origin = layout[0]
    assert edges[-1] == pytest.approx(period)
    basis = modal_blocks(p.structure).basis
    rest = (edges, nodes, origin, tables().nodes, arguments[0], delays, p.delay_variation, False, True, p.tool_speed,
            1e4, 0.3, basis, *arguments[1:], *p.coefficients)
    for a, b in zip(cut.channels(*rest), cut.channels.py_func(*rest), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(("n", "lam"), [
    (2, -50 + 300j), (5, -800 + 0j), (5, -50 + 2000j), (12, -50 + 3000j), (12, -5 + 9000j), (24, -300 + 9000j)])
def test_moments_are_the_integrals(n: int, lam: complex) -> None:
    t, h = tables(), 1.3e-3
    q = t.points.shape[1] // t.nodes.shape[1] * (n + 1)
    propagated, final = np.empty((n, n), complex), np.empty(n, complex)
    operators.moments(lam, h, n, t.ell[n], t.points[n, :q], t.weights[n, :q], t.nodes[n], propagated, final)
    nodes = t.nodes[n, :n]
    scale = np.abs(final).max()
    for j in (0, n - 1):
        def polynomial(s: float, j: int = j) -> float:
            others = np.delete(nodes, j)
            return float(np.prod((s - others) / (nodes[j] - others)))

        for end, found in ((nodes[n // 2], propagated[n // 2, j]), (1.0, final[j])):
            parts = [quad(lambda s, part=part, end=end: part(np.exp(lam * h * (end - s))) * polynomial(s) * h, 0, end,
                          limit=400)[0] for part in (np.real, np.imag)]
            assert abs(found - complex(*parts)) < 2e-6 * scale


def test_interpolation_reproduces_polynomials_and_nodes() -> None:
    t, n = tables(), 9
    support = t.support[n, :n + 2]
    for s in (0.0, 0.123, support[4], 1.0):
        row = operators.interpolation_row(s, n, t.support[n], t.bary[n])
        assert row @ support**6 == pytest.approx(s**6, abs=1e-12)
        np.testing.assert_array_equal(row, operators.interpolation_row.py_func(s, n, t.support[n], t.bary[n]))


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 20), st.integers(0, 10**6))
def test_factors_solve(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, x = rng.standard_normal((n, n)), rng.standard_normal(n)
    LU, pivot, found = A.copy(), np.empty(n, dtype=np.int64), A @ x
    operators.factorise(LU, pivot)
    operators.substitute(LU, pivot, found)
    np.testing.assert_allclose(found, x, rtol=1e-6, atol=1e-7 * np.linalg.cond(A))


@settings(max_examples=200, deadline=None)
@given(st.integers(1, 20), st.integers(0, 10**6))
def test_largest_eigenvalue_is_that_of_numpy(n: int, seed: int) -> None:
    H = np.triu(np.random.default_rng(seed).standard_normal((n, n)), -1)
    expected = np.abs(np.linalg.eigvals(H)).max()
    found = spectrum.largest_eigenvalue(H)
    assert abs(found) == pytest.approx(expected, rel=1e-9)
    assert found.imag >= 0
    y = spectrum.ritz_vector(H, n, found)
    assert np.linalg.norm(y) == pytest.approx(1.0)


def test_eigenvalues_of_special_matrices() -> None:
    assert spectrum.largest_eigenvalue(np.zeros((4, 4))) == 0
    assert spectrum.largest_eigenvalue(np.diag([1.0, -2, 3, 0])) == 3
    assert spectrum.largest_eigenvalue(np.array([[0, 1.0], [-1, 0]])) == pytest.approx(1j)
    cyclic = np.roll(np.eye(5), 1, axis=0)  # all of magnitude 1: plain shifts stall
    assert abs(spectrum.largest_eigenvalue(cyclic)) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", [1, 4])
def test_one_period_is_its_plain_self(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The matrix column by column from the compiled and the plain map."""
    p = random_problem(seed)
    compiled = period_map(p, 0.0).matrix
    monkeypatch.setattr(operators, "apply_period", operators.apply_period.py_func)
    monkeypatch.setattr(operators, "dense_map", operators.dense_map.py_func)
    np.testing.assert_allclose(period_map(p, 0.0).matrix, compiled, rtol=1e-9, atol=1e-12 * np.abs(compiled).max())
