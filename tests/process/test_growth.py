"""A perturbation of the cut grows or decays as the Floquet multipliers say."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.process.cases import BENCHMARK_MODE, RPM, at, exact_config, milling, multiplier, run, turn_milling
from turnmill_core.operation import Mode, Operation
from turnmill_core.process.simulation import simulate
from turnmill_core.process.truth import join_truth
from turnmill_core.stability.floquet import verdict_from_map
from turnmill_core.stability.operating_point import stability_problem
from turnmill_core.stability.semidiscretization import period_map

X = (1.0, 0.0, 0.0)
Y = (0.0, 1.0, 0.0)


@pytest.mark.parametrize(("depth", "published"), [(2e-4, 0.81974278), (5e-4, 1.07397559), (1e-3, 1.40647353)])
def test_growth_is_that_of_the_textbook_case(depth: float, published: float) -> None:
    """Insperger and Stepan's benchmark, full immersion, 5000 rpm, one degree of freedom."""
    found = multiplier(at(milling(), depth=depth), rate=200_000)
    assert math.log(abs(found)) == pytest.approx(math.log(published), rel=0.003)


def leading(op: Operation, steps: int = 100) -> complex:
    """Leading multiplier by semi-discretization, extrapolated from two resolutions."""
    found = []
    for k in (steps, 2 * steps):
        values = np.linalg.eigvals(period_map(stability_problem(op, op.conditions), k).matrix)
        first = values[np.argmax(np.abs(values))]
        found.append(complex(first.real, abs(first.imag)))
    return found[1] + (found[1] - found[0]) / 3


CASES = {
    "up-milling, two modes": milling((BENCHMARK_MODE, replace(BENCHMARK_MODE, shape=Y)), span=(3e-3, 5e-3), depth=1e-3),
    "down-milling, 3 teeth": milling((replace(BENCHMARK_MODE, shape=Y),), teeth=3, span=(-5e-3, -4e-3), depth=8e-4,
                                     speed=9000 * RPM),
    "helix": milling((BENCHMARK_MODE,), span=(0.0, 5e-3), depth=2e-3, helix_angle=math.radians(30)),
    "turn-milling": turn_milling((Mode(782.0, 0.02, 0.7, X), Mode(810.0, 0.03, 0.9, Y)), depth=2e-3),
    "turn-milling, fast workpiece": turn_milling((Mode(782.0, 0.02, 0.7, X),), workpiece_speed=90 * RPM, depth=1.5e-3),
    "turn-milling, down, workpiece modes": turn_milling((), depth=2e-3, sense="down", axial_feed=6e-3,
                                                        workpiece_modes=(Mode(500.0, 0.02, 1.0, (0.6, 0.8, 0.0)),)),
    "flip": milling((Mode(250.0, 0.02, 1.2, Y),), teeth=3, span=(-5e-3, -4.5e-3), depth=4e-3, speed=10500 * RPM),
}


@pytest.mark.parametrize("name", CASES)
def test_growth_and_frequency_are_those_of_the_stability_solver(name: str) -> None:
    op = CASES[name]
    expected, found = leading(op), multiplier(op)
    assert abs(math.log(abs(expected))) > 0.02
    assert math.log(abs(found)) == pytest.approx(math.log(abs(expected)), rel=0.01)
    assert abs(np.angle(found)) == pytest.approx(abs(np.angle(expected)), abs=0.01)


def test_variable_pitch() -> None:
    """Unequal pitch: the principal period is the spindle's, two tooth periods of two teeth."""
    op = milling((BENCHMARK_MODE,), depth=6e-4, pitch_angles=(math.pi - 0.15, math.pi + 0.15))
    expected, found = leading(op), multiplier(op, rate=200_000) ** 2
    assert math.log(abs(found)) == pytest.approx(math.log(abs(expected)), rel=0.01)


def test_rotation_of_the_workpiece_lengthens_the_delay() -> None:
    """The mean delay Td (1 + Omega_c/Omega_t) (Eq. 4.88) changes the growth of the cut."""
    mode = (Mode(782.0, 0.02, 0.7, X),)
    still, turning = (multiplier(turn_milling(mode, workpiece_speed=w * RPM, depth=3e-3)) for w in (0.6, 90.0))
    assert abs(math.log(abs(still)) - math.log(abs(turning))) > 0.02


def test_a_slow_workpiece_is_ordinary_milling() -> None:
    """As the workpiece's speed goes to 0 and its radius is large, the cut is that of a block."""
    modes = (Mode(600.0, 0.03, 0.5, X), Mode(700.0, 0.03, 0.5, Y))
    bar = turn_milling(modes, workpiece_speed=1e-3, depth=1e-3)
    wide = 1000.0
    bar = replace(bar, workpiece=replace(bar.workpiece, diameter=2 * wide), conditions=replace(
        bar.conditions, effective_radius=wide - 1e-3, workpiece_speed=1e-4,
        feed_speed=bar.axial_feed * 1e-4 / (2 * math.pi)))
    speed = bar.conditions.resultant_feed_speed
    feed = speed * 2 * math.pi / (2 * bar.conditions.tool_speed)
    block = milling(modes, speed=bar.conditions.tool_speed, depth=1e-3, feed=feed)
    block = replace(block, tool=replace(block.tool, diameter=20e-3), milling_sense="up", workpiece=replace(
        block.workpiece, width=8e-3), conditions=replace(block.conditions, cross_feed_span=(2e-3, 10e-3)))
    config = exact_config(channels=("tool_x", "tool_y", "force_x", "force_y"))
    a, b = run(bar, config, 0.1), run(block, config, 0.1)
    assert np.abs(b).max(axis=0).min() > 0
    np.testing.assert_allclose(a[5000:], b[5000:], atol=2e-3 * np.abs(b).max())


def test_chatter_saturates_by_loss_of_contact_at_the_solvers_frequency() -> None:
    """Above the limit the amplitude stops growing; the chatter frequency is the linear one within 0.5 %."""
    op = at(milling(), depth=5e-4)
    truth = join_truth(chunk.truth for chunk in simulate(op, exact_config(50_000), 0, duration=1.2))
    late = truth.asynchronous[truth.time > 0.8]
    assert late.min() > 2e-6
    assert np.ptp(late) < 0.1 * late.mean()
    problem = stability_problem(op, op.conditions)
    result = period_map(problem, 160)
    family = [line.frequency for line in verdict_from_map(result.matrix, result.displacement, result.period).lines]
    assert min(abs(truth.frequency[-1] / f - 1) for f in family) < 0.005


def random_cut(seed: int) -> Operation:
    """A cut drawn from everything the simulator describes; depths around the limit."""
    draw = np.random.default_rng(seed)
    modes = tuple(
        Mode(float(draw.uniform(300, 1500)), float(draw.uniform(0.01, 0.05)), float(draw.uniform(0.1, 1.0)), shape)
        for shape in (X, Y, (0.6, 0.8, 0.0))[: int(draw.integers(1, 4))])
    helix = float(draw.choice([0.0, 0.3, 0.6]))
    teeth = int(draw.integers(1, 5))
    depth = float(10 ** draw.uniform(-3.5, -2.3))
    speed = float(draw.uniform(2500, 12000)) * RPM
    if draw.random() < 0.5:
        return turn_milling((), workpiece_speed=float(draw.choice([-1, 1]) * draw.uniform(1, 60)) * RPM, speed=speed,
                            depth=depth, sense=str(draw.choice(["up", "down"])),
                            axial_feed=float(draw.uniform(1e-3, 10e-3)), workpiece_modes=modes, teeth=teeth,
                            helix_angle=helix)
    span = [(-5e-3, 5e-3), (float(draw.uniform(0, 4e-3)), 5e-3), (-5e-3, -float(draw.uniform(0, 4e-3)))]
    return milling(modes, teeth=teeth, speed=speed, depth=depth, span=span[int(draw.integers(3))], helix_angle=helix)


def seeded_cuts(count: int) -> Iterator[tuple[Operation, float]]:
    """Random cuts and their |mu|, where that is more than 0.02 from 1 and does not vanish in a period."""
    seeds = itertools.count()
    while count:
        op = random_cut(next(seeds))
        expected = abs(leading(op, 160))
        if abs(expected - 1) >= 0.02 and expected >= 0.3:
            count -= 1
            yield op, expected


@pytest.mark.slow
def test_growth_at_seeded_points() -> None:
    """ln|mu| within 1 % of the solver's wherever |mu| is more than 0.02 from 1 and does not vanish in a period."""
    compared = [math.log(abs(multiplier(op))) / math.log(expected) - 1 for op, expected in seeded_cuts(50)]
    assert max(map(abs, compared)) < 0.01
