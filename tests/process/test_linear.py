"""The linear time solution: its loads, its steady state, its growth, its energy; against independent solutions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import LinearOperator, eigs

from tests.process.cases import ALUMINIUM, BENCHMARK_MODE, RPM, at, exact_config, milling, run, turn_milling
from tests.process.test_growth import CASES, leading, seeded_cuts
from turnmill_core.cutting.forces import revolution
from turnmill_core.operation import Material, Mode, Operation
from turnmill_core.process._kernels.march import march
from turnmill_core.process.linear import LinearMap, MapState, advance, at_rest, linear_map
from turnmill_core.process.linear_cut import linear_cut, load_matrices, mean_load_matrices
from turnmill_core.process.periodic_orbit import orbit_state, periodic_orbit
from turnmill_core.process.vibration import Vibration, chip_at, in_frame, smallest_chip, time_solution
from turnmill_core.stability.problem import directional_matrix
from turnmill_core.structure.modal import frf, modal_model

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
EDGES = Material("aluminium", 700e6, 250e6, 90e6, 21e3, 25e3, 8e3)
TURNED = turn_milling((Mode(782.0, 0.02, 0.7, X), Mode(810.0, 0.03, 0.9, Y), Mode(1900.0, 0.03, 1.0, Z)), depth=1e-3,
                      helix_angle=math.radians(25), material=EDGES,
                      workpiece_modes=(Mode(500.0, 0.02, 3.0, (0.6, 0.6, 0.3)),))
MILLED = milling((BENCHMARK_MODE, replace(BENCHMARK_MODE, frequency=800.0, shape=(0.2, 0.8, 0.5))), span=(3e-3, 5e-3),
                 depth=1e-4, material=EDGES)
RUNNING_OUT = milling(MILLED.tool.structure.modes, span=(-3e-3, 3e-3), depth=1e-4, material=EDGES,
                      runout=(5e-6, -5e-6))
UNEVEN = milling((BENCHMARK_MODE,), depth=1e-4, pitch_angles=(math.pi - 0.15, math.pi + 0.15))


def made(op: Operation, steps: int | None = None) -> LinearMap:
    """Map of the nominal cut."""
    return linear_map(linear_cut(op, op.conditions), steps)


@pytest.mark.parametrize("op", [TURNED, MILLED, RUNNING_OUT, UNEVEN], ids=["bar", "block", "runout", "pitch"])
def test_static_loads_are_those_of_the_rigid_cut(op: Operation) -> None:
    """Rigid limit: without vibration, force and both torques are those of the cutting room (Eq. 4.122)."""
    turn = revolution(op, op.conditions, 720, 256)
    found = load_matrices(linear_cut(op, op.conditions), turn.angle).static
    for columns, expected in ((slice(0, 3), turn.force_tool), (3, turn.tool_torque), (4, turn.workpiece_torque)):
        size = np.abs(expected).max()
        difference = np.abs(found[:, columns] - expected) if size else np.abs(found[:, columns])
        assert np.quantile(difference, 0.99) <= 4e-3 * size
        assert np.abs(found[:, columns].mean(axis=0) - expected.mean(axis=0)).max() <= 3e-3 * size


def test_dynamic_loads_are_the_directional_matrices_of_stability() -> None:
    cut = linear_cut(TURNED, TURNED.conditions)
    angle = np.linspace(0, 2 * math.pi, 97)
    gain = load_matrices(cut, angle).gain[:, :, :3]
    for j, offset in enumerate(cut.problem.tooth_angles):
        expected = directional_matrix(cut.problem, angle + offset)
        np.testing.assert_allclose(gain[j], expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize("op", [TURNED, MILLED, RUNNING_OUT, UNEVEN], ids=["bar", "block", "runout", "pitch"])
def test_steady_state_is_the_periodic_orbit(op: Operation) -> None:
    """After its transient, the marched solution is the orbit that was solved for, to 1e-8."""
    step_map = made(op)
    solution, _ = time_solution(step_map, 400 if op is TURNED else 600)
    steady = periodic_orbit(step_map, revolution=False)
    size = np.abs(steady.relative).max()
    assert np.abs(solution.relative[-step_map.steps :] - steady.relative).max() < 1e-8 * size
    assert np.abs(solution.force[-step_map.steps :] - steady.force).max() < 1e-8 * np.abs(steady.force).max()


def test_orbit_exists_above_the_limit() -> None:
    """An unstable cut has a periodic solution too, which marching never reaches."""
    step_map = made(at(milling(), depth=5e-4))
    state = orbit_state(step_map)
    after, _, _ = advance(step_map, state, step_map.steps)
    assert np.abs(after.past - state.past).max() < 1e-9 * np.abs(state.past).max()


def test_milling_orbit_is_the_static_force_through_the_receptance() -> None:
    """Equal teeth without workpiece rotation: d(t) = d(t - tau), so the chip does not see the steady vibration."""
    steady = periodic_orbit(made(MILLED, 1200))
    force = load_matrices(steady.cut, steady.angle).static[:, :3]
    np.testing.assert_allclose(steady.force, force, atol=1e-8 * np.abs(force).max())
    step = steady.angle[1]
    mean = mean_load_matrices(steady.cut, (np.arange(len(force) + 1) - 0.5) * step).static[:, :3]
    lines = np.fft.rfft(mean, axis=0)
    receptance = frf(modal_model(MILLED.tool.structure, MILLED.workpiece.structure),
                     np.arange(len(lines)) * MILLED.conditions.tool_speed / (2 * math.pi))
    expected = np.fft.irfft(np.einsum("kij,kj->ki", receptance, lines), len(force), axis=0)
    assert np.abs(steady.relative - expected).max() < 1e-4 * np.abs(expected).max()


def nonlinear(op: Operation, rate: int, turns: int, first: int, **other: object) -> np.ndarray:
    """Tool displacement of the nonlinear simulation over turns `first` to `turns`, (n, 3)."""
    period = 2 * math.pi / op.conditions.tool_speed
    config = exact_config(rate, ("tool_x", "tool_y", "tool_z"), block_duration=period, **other)
    found = run(op, config, turns * period + 1e-9)
    return found[round(first * period * rate) : round(turns * period * rate)]


def test_linear_and_nonlinear_time_solution_agree_in_contact() -> None:
    """From rest through the transient, while no chip vanishes: within 0.1 %."""
    op = milling((Mode(600.0, 0.05, 1.0, X), Mode(900.0, 0.05, 1.0, Y), Mode(1500.0, 0.05, 1.0, Z)), speed=3000 * RPM,
                 depth=5e-4, span=(-3e-3, 3e-3), helix_angle=math.radians(30), material=EDGES)
    steps = 1500
    solution, _ = time_solution(made(op, steps), 8)
    assert smallest_chip(solution) > 0.4
    found = nonlinear(op, 2 * steps * 50, 4, 0, slices=16)
    size = np.abs(solution.tool).max(axis=0)
    assert np.all(np.abs(found - solution.tool).max(axis=0) < 1e-3 * size)


@pytest.mark.parametrize("material", [ALUMINIUM, EDGES], ids=["shear", "edge forces"])
def test_orbit_is_the_steady_state_of_the_nonlinear_simulation(material: Material) -> None:
    """Turn-milling with helix, contact kept: within 0.1 % of the largest displacement in each direction."""
    op = at(replace(TURNED, material=material), depth=4e-4)
    op = replace(op, workpiece=replace(op.workpiece, structure=replace(op.workpiece.structure, modes=())))
    steps = 1200
    steady = periodic_orbit(made(op, steps))
    found = nonlinear(op, steps * 100, 41, 40, loss_of_contact=False, slices=16)
    assert np.all(np.abs(found - steady.tool).max(axis=0) < 1e-3 * np.abs(steady.tool).max(axis=0))


@pytest.mark.parametrize("name", ["helix", "turn-milling, fast workpiece", "flip"])
def test_perturbation_grows_as_the_multipliers_say(name: str) -> None:
    """ln|mu| over a period of the map is the stability solver's within 1 %."""
    op = CASES[name]
    assert growth(made(op, 400)) == pytest.approx(math.log(abs(leading(op))), rel=0.01)


@pytest.mark.slow
def test_growth_at_seeded_points() -> None:
    """50 random cuts of bars and blocks, where |mu| is more than 0.02 from 1 and does not vanish in a period."""
    compared = [growth(made(op, 320)) / math.log(expected) - 1 for op, expected in seeded_cuts(50)]
    assert max(map(abs, compared)) < 0.01


def growth(step_map: LinearMap) -> float:
    """ln|mu| of the map: the multiplier of largest magnitude, by Arnoldi's method on the march over a period."""
    n = step_map.P.shape[1]
    weight = np.concatenate([2 * np.pi * step_map.cut.modes.modes.frequency, np.ones(n // 2)])

    def over_period(s: np.ndarray) -> np.ndarray:
        start = MapState(s[:n] / weight, s[n:].reshape(-1, 2))
        after = advance(step_map, start, step_map.steps, forced=False)[0]
        return np.concatenate([after.x * weight, after.past.ravel()])

    size = n + 2 * step_map.back
    operator = LinearOperator((size, size), matvec=lambda s: over_period(s.ravel()))
    found = eigs(operator, k=4, v0=np.cos(np.arange(size)), ncv=min(40, size - 1), return_eigenvectors=False)
    return math.log(float(np.abs(found).max()))


def dissipation(steady: Vibration) -> float:
    """Energy [J] that the modes dissipate over the samples of `steady`."""
    model = steady.cut.modes.modes
    rate = (2 * model.damping * 2 * np.pi * model.frequency * steady.states[:, model.size :] ** 2).sum(axis=1)
    return float(rate.mean()) * steady.time.size * float(steady.time[1])


@pytest.mark.parametrize("op", [TURNED, MILLED], ids=["bar", "block"])
def test_cutting_forces_do_the_work_that_the_modes_dissipate(op: Operation) -> None:
    steady = periodic_orbit(made(op, 2000))
    work = float(np.mean((steady.force * steady.relative_velocity).sum(axis=1))) * steady.time.size * steady.time[1]
    assert work == pytest.approx(dissipation(steady), rel=5e-3)


def test_second_order_convergence() -> None:
    """The distance to a fine solution falls with the square of the step."""
    fine = periodic_orbit(made(TURNED, 3200), revolution=False).relative[::3200 // 100]
    errors = [np.abs(periodic_orbit(made(TURNED, k), revolution=False).relative[:: k // 100] - fine).max()
              for k in (200, 400, 800)]
    slope = np.polyfit(np.log([200, 400, 800]), np.log(errors), 1)[0]
    assert -2.6 < slope < -1.6


def test_chip_at_a_contact_point() -> None:
    """Milling in steady state: the chip is f sin(phi), and the force density its coefficients times it."""
    op = milling((BENCHMARK_MODE,), depth=1e-4, span=(2e-3, 5e-3), material=ALUMINIUM)
    steady = periodic_orbit(made(op))
    chip, force = chip_at(steady, 5e-5)
    inside = ~np.isnan(chip[:, 0])
    expected = op.feed_per_tooth * np.sin(steady.angle)
    np.testing.assert_allclose(chip[inside, 0], expected[inside], atol=1e-12)
    np.testing.assert_allclose(force[inside, 0, 2], -ALUMINIUM.Kac * chip[inside, 0], rtol=1e-9)
    assert np.all(force[~inside, 0] == 0)
    with pytest.raises(ValueError, match="height is"):
        chip_at(steady, 1.0)


def test_frames() -> None:
    op = TURNED
    vectors, time = np.eye(3), np.full(3, 0.25 * 2 * math.pi / op.conditions.workpiece_speed)
    machine = in_frame(vectors, op, op.conditions, "machine", time)
    np.testing.assert_allclose(machine[2], X, atol=1e-12)  # z_T = x_M
    turned = in_frame(vectors, op, op.conditions, "workpiece", time)
    np.testing.assert_allclose(turned[2], (0.0, -1.0, 0.0), atol=1e-12)  # the bar has turned a quarter about z
    with pytest.raises(ValueError, match="frame is"):
        in_frame(vectors, op, op.conditions, "world", time)


def test_power_of_a_rigid_slot() -> None:
    """Tool power is torque times speed, and the torque the mean of two straight teeth, a f R Ktc / pi times 2."""
    op = milling((Mode(25e3, 0.5, 1e3, X), Mode(25e3, 0.5, 1e3, Y)), depth=1e-3)
    steady = periodic_orbit(made(op, 720))
    mean = 2 / math.pi * 1e-3 * op.feed_per_tooth * 600e6 * op.tool.radius
    assert steady.tool_torque.mean() == pytest.approx(mean, rel=1e-4)
    assert steady.tool_power.mean() == pytest.approx(mean * op.conditions.tool_speed, rel=1e-4)
    assert np.all(steady.workpiece_power == 0)


def test_march_and_its_plain_version_agree() -> None:
    step_map = made(RUNNING_OUT, 80)
    rest = at_rest(step_map)
    results = []
    for run_march in (march, march.py_func):
        states, contact = np.zeros((200, rest.x.size)), np.zeros((200 + step_map.back, 2))
        run_march(step_map.P, step_map.Q0, step_map.Q1, step_map.E, step_map.lag,
                  np.ascontiguousarray(step_map.cut.problem.structure.C[:2]), True, states, contact)
        results.append((states, contact))
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-12, atol=1e-18)
    assert np.abs(results[0][1]).max() > 0
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=1e-12, atol=1e-18)


def test_steps_shorter_than_the_delay_are_asked_for() -> None:
    with pytest.raises(ValueError, match="delay is"):
        linear_map(linear_cut(UNEVEN, UNEVEN.conditions), 2)
