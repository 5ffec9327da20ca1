"""The reference solver against closed form, limits, published values and direct integration."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stability.cases import PUBLISHED, textbook
from turnmill_core.operation import RIGID, Mode, Structure
from turnmill_core.prediction import PredictedType
from turnmill_core.stability import collocation, zero_order
from turnmill_core.stability.floquet import classify
from turnmill_core.stability.problem import StabilityProblem, constant_engagement, directional_matrix
from turnmill_core.stability.semidiscretization import default_steps, leading_multiplier, period_map, solve
from turnmill_core.structure.modal import frf, modal_model, state_space


def radius(problem: StabilityProblem, steps: int, order: int = 1) -> float:
    """Spectral radius by the reference solver."""
    return abs(leading_multiplier(problem, steps, order))


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("depth", PUBLISHED)
def test_converges_to_the_textbook_values_with_second_order(depth: float, order: int) -> None:
    steps = np.array([80, 120, 160, 240])
    error = [abs(radius(textbook(depth), k, order) - PUBLISHED[depth]) for k in steps]
    slope = np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert slope == pytest.approx(-2.0, abs=0.06)
    extrapolated = (4 * radius(textbook(depth), 240, order) - radius(textbook(depth), 120, order)) / 3
    assert extrapolated == pytest.approx(PUBLISHED[depth], abs=3e-5)


def test_a_delay_between_grid_points_converges_too() -> None:
    """Erratum D10: which weight belongs to which past step shows only here."""
    problem = textbook(0.5e-3, exit=1.5, axes=2, shift=0.033)
    zero, first = ([radius(problem, k, order) for k in (100, 300, 900)] for order in (0, 1))
    assert zero[2] == pytest.approx(first[2], abs=1e-4)
    for values in (zero, first):
        assert abs(values[0] - first[2]) < 1.2e-2
        assert abs(values[1] - first[2]) < 1.2e-3


def test_workpiece_speed_to_zero_is_milling() -> None:
    milling = radius(textbook(0.5e-3, exit=1.5), 80)
    gaps = [abs(radius(textbook(0.5e-3, exit=1.5, shift=s), 80) - milling) for s in (1e-3, 1e-5, 1e-7)]
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < 1e-6


def test_four_teeth_in_a_slot_are_turning() -> None:
    """The directional matrix of four straight teeth in a slot is constant: the closed form of the lobes holds.

    For a mode along x, F = -Krc a (x - x_tau): a_lim = -1 / (2 Krc Re G) and the delay follows from the phase.
    """
    model = modal_model(Structure((Mode(922.0, 0.011, 0.03993, (1, 0, 0)),)), RIGID)
    Krc = 200e6
    for f, lobe in ((935.0, 1), (960.0, 1), (950.0, 3)):
        G = frf(model, [f])[0, 0, 0]
        depth = -1 / (2 * Krc * G.real)
        phase = -np.angle(1 + 1 / (Krc * depth * G)) % (2 * np.pi)
        tau = (phase + 2 * np.pi * lobe) / (2 * np.pi * f)
        rpm = 30 / np.pi * (np.pi / 2) / tau
        problem = textbook(depth, rpm=rpm, teeth=4)
        leading = leading_multiplier(problem, 400)
        assert abs(leading) == pytest.approx(1.0, abs=2e-4)
        turns = np.array([1, -1])[:, None] * np.angle(leading) / (2 * np.pi) + np.arange(9)
        lines = turns / problem.period
        assert np.min(np.abs(lines - f)) < 0.3


@pytest.mark.parametrize(("depth", "shift", "lag"), [(0.4e-3, 0.0, 0.0), (0.2e-3, 0.05, 800.0)])
def test_direct_integration_grows_at_the_same_rate(depth: float, shift: float, lag: float) -> None:
    """Heun's method with its own grid and history on the same equation, growth over many periods."""
    problem = textbook(depth, rpm=9000, exit=2.0, axes=2, shift=shift, lag=lag)
    k, periods = 300, 120
    dt = problem.period / k
    A, B, C = problem.structure.A, problem.structure.B, problem.structure.C[:2]
    G = sum(directional_matrix(problem, problem.tool_speed * dt * np.arange(k) + a) for a in problem.tooth_angles)
    back = problem.delays[0] / dt
    whole, part = int(back), back - int(back)
    rng = np.random.default_rng(3)
    x = rng.standard_normal(4) * [1e-6, 1e-6, 1e-2, 1e-2]
    d = np.zeros((k * periods + 1, 2))
    d[0] = C @ x
    past = lambda i: (1 - part) * d[i - whole] + part * d[i - whole - 1] if i > whole else np.zeros(2)  # noqa: E731
    norm = []
    for i in range(k * periods):
        slope = A @ x + B @ G[i % k] @ (C @ x - past(i))
        guess = x + dt * slope
        x = x + dt / 2 * (slope + A @ guess + B @ G[(i + 1) % k] @ (C @ guess - past(i + 1)))
        d[i + 1] = C @ x
        if (i + 1) % (k * 30) == 0:
            norm.append(np.linalg.norm(d[i + 1 - 4 * k:i + 2]))
    growth = (norm[-1] / norm[0]) ** (1 / (30 * (len(norm) - 1)))
    assert growth == pytest.approx(radius(problem, 400), abs=6e-3)


def test_turning_the_frame_about_the_tool_axis_changes_nothing() -> None:
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    modes = (Mode(900.0, 0.02, 0.05, (1, 0.2, 0.3)), Mode(1300.0, 0.01, 0.1, (-0.3, 1, 0.1)))
    structures = [modal_model(Structure(modes, "machine"), RIGID, frame) for frame in (turn.T, np.eye(3))]
    radii = []
    for model, start in zip(structures, (0.9 + angle, 0.9), strict=True):
        problem = textbook(1e-3).at(structure=state_space(model), coefficients=(600e6, 200e6, 90e6))
        e = constant_engagement(1e-3, start, start + 0.8)
        radii.append(radius(problem.at(engagement=e), 360))
    assert radii[0] == pytest.approx(radii[1], rel=2e-4)


def test_flip_at_low_immersion_and_hopf_beside_it() -> None:
    kinds = set()
    for rpm in np.linspace(16000, 24000, 17):
        problem = textbook(2.5e-3, rpm=rpm, start=np.pi - np.arccos(1 - 0.1), exit=np.pi)
        kinds.add(classify(np.linalg.eigvals(period_map(problem, 60).matrix)))
    assert kinds == {PredictedType.STABLE, PredictedType.FLIP, PredictedType.HOPF}


def test_flip_verdict_has_half_order_lines() -> None:
    problem = textbook(2.5e-3, rpm=18000, start=np.pi - np.arccos(1 - 0.1), exit=np.pi)
    found = solve(problem, 80)
    assert found.predicted_type is PredictedType.FLIP
    tooth = 2 * 18000 / 60
    assert found.chatter_frequency / tooth % 1 == pytest.approx(0.5, abs=1e-9)
    assert abs(found.chatter_frequency - 922) < tooth / 2


def test_the_leading_multiplier_is_that_of_the_matrix() -> None:
    for problem in (textbook(0.5e-3), textbook(0.3e-3, exit=1.5, axes=2, shift=0.3, lag=300.0)):
        mu = np.linalg.eigvals(period_map(problem, 60).matrix)
        assert radius(problem, 60) == pytest.approx(np.abs(mu).max(), rel=1e-8)


@pytest.mark.parametrize(("arguments", "message"), [((1, 1), "steps"), ((40, 2), "order")])
def test_impossible_resolution_is_refused(arguments: tuple[int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        period_map(textbook(1e-3), *arguments)


def test_a_delay_shorter_than_a_step_is_refused() -> None:
    with pytest.raises(ValueError, match="delay"):
        period_map(textbook(1e-3, shift=-0.99), 40)


def test_default_resolution_follows_the_fastest_mode() -> None:
    assert default_steps(textbook(1e-3, rpm=500)) > 8 * default_steps(textbook(1e-3, rpm=5000))


def test_three_methods_give_one_kind_of_verdict() -> None:
    """Where all three are exact they agree: four straight teeth in a slot."""
    problem = textbook(0.3e-3, rpm=7000, teeth=4, axes=2)
    found = [solve(problem, 400), collocation.solve(problem), zero_order.solve(problem)]
    for verdict in found:
        assert verdict.spectral_radius == pytest.approx(found[1].spectral_radius, abs=1e-3)
        assert verdict.predicted_type is PredictedType.HOPF
        assert verdict.chatter_frequency == pytest.approx(found[1].chatter_frequency, abs=0.2)
        assert verdict.period == problem.period
