"""State in, state out: determinism, chunks, convergence, energy, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.process.cases import BENCHMARK_MODE, RPM, SILENT, at, exact_config, milling, run, samples, turn_milling
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Mode, Operation, SchedulePoint
from turnmill_core.process.simulation import Chunk, SimulationConfig, block_due_ns, initial, simulate, step
from turnmill_core.process.truth import join_truth

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def ramping() -> Operation:
    """Both speeds and the depth change within 0.2 s, from air into chatter."""
    op = turn_milling((Mode(782.0, 0.02, 0.2, X), Mode(810.0, 0.03, 0.3, Y)), helix_angle=0.4)
    return replace(op, schedule=(
        SchedulePoint(0.0, 2800 * RPM, 5 * RPM, -1e-3), SchedulePoint(0.08, 3000 * RPM, 8 * RPM, 3e-3),
        SchedulePoint(0.2, 3300 * RPM, 6 * RPM, 5e-3)))


AXES = [axis_state_at(ramping(), 0.004 * k, 4_000_000 * k) for k in range(51)]
CONFIG = SimulationConfig(sample_rate=12800, channels=("sound", "tool_x", "workpiece_y", "force_z"), start_ns=0)


def in_chunks(sizes: list[int]) -> tuple[np.ndarray, list[int]]:
    state = initial(ramping(), CONFIG, 7)
    chunks, first = [], 0
    for size in [*sizes, len(AXES)]:
        state, chunk = step(CONFIG, state, AXES[first : first + size])
        chunks.append(chunk)
        first += size
    return samples(chunks), [b.first_sample for c in chunks for b in c.blocks]


@settings(max_examples=12, deadline=None)
@given(st.lists(st.integers(0, 20), max_size=8))
def test_chunks_do_not_change_a_bit(sizes: list[int]) -> None:
    whole, whole_index = in_chunks([])
    cut, cut_index = in_chunks(sizes)
    assert len(whole) == 9 * 256
    assert np.abs(whole[-500:, 1]).max() > 1e-6
    np.testing.assert_array_equal(whole, cut)
    assert whole_index == cut_index == [256 * i for i in range(9)]


def test_a_block_comes_with_the_first_axis_state_that_reaches_its_time() -> None:
    state, due = initial(ramping(), CONFIG, 7), []
    for axes in AXES:
        before = block_due_ns(CONFIG, state)
        state, chunk = step(CONFIG, state, [axes])
        assert len(chunk.blocks) == (axes.stamp_ns >= before)
        due += [before - b.stamp_ns for b in chunk.blocks]
    assert len(due) == 9
    assert 19_900_000 < min(due) <= max(due) < 23_000_000


def test_the_truth_does_not_depend_on_chunks_either() -> None:
    op = milling(depth=5e-4)
    a = join_truth(c.truth for c in simulate(op, exact_config(50_000), 0, duration=0.2))
    b = join_truth(c.truth for c in simulate(op, exact_config(50_000, block_duration=0.05), 0, duration=0.2))
    n = min(len(a.time), len(b.time))
    assert n > 4
    for name in ("time", "synchronous", "asynchronous", "half_order"):
        np.testing.assert_array_equal(getattr(a, name)[:n], getattr(b, name)[:n])


def test_the_seed_decides_the_noise_and_nothing_else() -> None:
    op = milling(depth=5e-4)
    config = SimulationConfig(sample_rate=12800, channels=("tool_x",), displacement_noise=1e-7, sound=SILENT)
    one, again, other = (run(op, config, 0.1, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    clean = run(op, replace(config, displacement_noise=0.0), 0.1)
    assert np.std(one - clean) == pytest.approx(1e-7, rel=0.1)
    assert abs(np.corrcoef((one - clean)[:, 0], (other - clean)[:, 0])[0, 1]) < 0.1


def test_blocks_are_stamped_with_their_first_sample() -> None:
    config = replace(CONFIG, start_ns=1_700_000_000_000_000_000)
    blocks = [b for c in simulate(ramping(), config, 1) for b in c.blocks]
    assert len(blocks) == 10
    for block in blocks:
        assert block.stamp_ns - config.start_ns == round(block.first_sample / 12800 * 1e9)
        assert len(block.samples) == 256
        assert [c.unit for c in block.channels] == ["Pa", "m", "m", "N"]
    axes = [a for c in simulate(ramping(), config, 1) for a in c.axes]
    assert [a.stamp_ns - config.start_ns for a in axes] == [4_000_000 * k for k in range(51)]


def test_samples_stand_where_their_stamps_say() -> None:
    """The anti-alias filter delays nothing: the decimated signal is the dense one at the same times."""
    op = at(milling((replace(BENCHMARK_MODE, frequency=400.0),)), depth=2e-4)
    dense = run(op, exact_config(102_400), 0.1)[:, 0]
    config = SimulationConfig(sample_rate=12_800, channels=("tool_x",), displacement_noise=0.0, sound=SILENT)
    found = run(op, config, 0.1)[:, 0]
    assert config.ratio == 8
    np.testing.assert_allclose(found[300:1200], dense[2400:9600:8], atol=0.02 * np.abs(dense).max())
    lag = np.argmax(np.correlate(dense[2400:9000], np.repeat(found, 8)[2800:8600], "valid"))
    assert abs(lag - 400 + 3.5) <= 1


def test_order_of_convergence_is_two() -> None:
    """Displacement of a chattering cut with loss of contact, against a fine solution: slope of log error."""
    op = replace(milling((BENCHMARK_MODE, replace(BENCHMARK_MODE, shape=Y, frequency=1100.0)), span=(0.0, 5e-3),
                         depth=5e-4), feed_per_tooth=1e-4)
    base, duration = 12_500, 0.03
    runs = {f: run(op, exact_config(base * f), duration)[:: f] for f in (1, 2, 4, 8, 32)}
    n = min(map(len, runs.values()))
    error = [np.sqrt(np.mean((runs[f][:n] - runs[32][:n]) ** 2)) for f in (1, 2, 4, 8)]
    slope = np.polyfit(np.log([1, 2, 4, 8]), np.log(error), 1)[0]
    assert error[-1] < 5e-3 * np.abs(runs[32]).max()
    assert slope == pytest.approx(-2, abs=0.3)


def test_work_of_the_cutting_force_is_what_the_damping_takes() -> None:
    """Energy over the last revolutions of a steady cut: integral of F dx against integral of c v^2 dt."""
    op = milling(depth=2e-4)
    rate = 240_000
    found = run(op, exact_config(rate, ("tool_x", "force_x")), 0.5)
    turn = round(rate * 60 / 5000)
    x, force = found[-8 * turn - 1 :].T
    velocity = np.diff(x) * rate
    damping = 2 * BENCHMARK_MODE.damping * math.sqrt(BENCHMARK_MODE.stiffness * BENCHMARK_MODE.mass)
    work = np.mean((force[1:] + force[:-1]) / 2 * velocity)
    lost = damping * np.mean(velocity**2)
    assert lost > 0
    assert work == pytest.approx(lost, rel=1e-4)


def test_the_linear_cut_is_the_true_one_while_the_tool_stays_in_contact() -> None:
    """Below the limit and without loss of contact both give the same displacement, to 0.1 %."""
    op = at(milling((replace(BENCHMARK_MODE, mass=0.4),)), depth=3e-4)
    true, linear = (run(op, exact_config(loss_of_contact=contact), 0.1) for contact in (True, False))
    np.testing.assert_allclose(true[3000:], linear[3000:], atol=1e-3 * np.abs(true).max())


def test_skipped_passes_are_remembered() -> None:
    """A tooth that stands out by two feeds cuts alone: every second pass is air, its chip is three feeds."""
    stiff = (Mode(20e3, 0.7, 1e6, X),)
    op = milling(stiff, teeth=3, runout=(2.5e-4, 0.0, 0.0), depth=1e-3, feed=1e-4)
    found = run(op, exact_config(90_000, ("force_z",)), 0.1)[-3240:, 0]  # three revolutions
    assert found.min() == pytest.approx(-1e-3 * 70e6 * 3e-4, rel=2e-3)
    assert np.mean(found < -1e-6) == pytest.approx(0.5, abs=0.01)


def test_speeds_far_from_the_nominal_are_simulated() -> None:
    """The spindle starts from rest in the air, then cuts; nothing depends on the nominal speed."""
    op = replace(milling(depth=2e-4), schedule=(
        SchedulePoint(0.0, 0.0, 0.0, -1e-3), SchedulePoint(0.1, 5000 * RPM, 0.0, -1e-3),
        SchedulePoint(0.11, 5000 * RPM, 0.0, 2e-4), SchedulePoint(0.3, 5000 * RPM, 0.0, 2e-4)))
    ramped = run(op, exact_config(60_000), 0.3)[-3600:, 0]
    steady = run(milling(depth=2e-4), exact_config(60_000), 0.3)[-3600:, 0]
    assert np.std(ramped) == pytest.approx(np.std(steady), rel=0.01)


@pytest.mark.parametrize(("wrong", "message"), [
    ({"sample_rate": 10}, "sample rate"), ({"channels": ()}, "channels"), ({"channels": ("tool_q",)}, "tool_q"),
    ({"channels": ("tool_x", "tool_x")}, "each once"), ({"oversampling": -1}, "oversampling"),
    ({"block_duration": 0.0}, "block duration"), ({"axes_rate": 0.0}, "axes rate"), ({"slices": 999}, "slices"),
    ({"displacement_noise": -1.0}, "displacement noise"), ({"force_noise": math.nan}, "force noise"),
])
def test_wrong_configurations_are_named(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SimulationConfig(**wrong)  # type: ignore[arg-type]


def test_wrong_input_is_named() -> None:
    op = milling()
    with pytest.raises(ValueError, match="seed"):
        initial(op, exact_config(), -1)
    with pytest.raises(ValueError, match="modal state shape"):
        initial(op, exact_config(), 0, np.zeros((7, 2)))
    with pytest.raises(ValueError, match="duration"):
        next(simulate(op, exact_config(), 0, duration=0.0))
    state = initial(op, exact_config(), 0)
    axes = axis_state_at(op, 0.1, 100_000_000)
    with pytest.raises(ValueError, match="ascending"):
        step(exact_config(), state, [axes, AxisState(50, axes.position, axes.velocity)])


def test_an_empty_chunk_changes_nothing() -> None:
    state = initial(milling(), exact_config(), 0)
    same, chunk = step(exact_config(), state, [])
    assert same is state
    assert chunk.axes == chunk.blocks == ()
    assert isinstance(chunk, Chunk)
    assert len(chunk.truth.time) == 0
