"""Verdicts depend on stamps alone: not on how topics interleave, nor on whether the cut is live or replayed."""

from __future__ import annotations

import math
import random
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.cutting.runout import half_order_share
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes, nominal_axes
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.operation import Operation
from turnmill_core.operation_cutter import Shape
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_core.prediction import PredictedType, Prior
from turnmill_core.stability.margin import stability_point
from turnmill_ros.monitor_join import FeedSettings, MonitorFeed

RATE = 6400.0
ROWS = 128
START = 1_000_000_000_000
SECONDS = 2.0
Step = Callable[[MonitorFeed], tuple[tuple[Verdict, str], ...]]


def operation() -> Operation:
    return read_operation(shipped_operations()["thesis_table_4_9"])


def blocks(op: Operation, seconds: float = SECONDS) -> list[SensorBlock]:
    """Tooth passing harmonics with half-order lines over noise: a signal on which the prediction matters."""
    t = np.arange(int(seconds * RATE)) / RATE
    tooth = op.tooth_passing_frequency
    x = sum(np.cos(2 * np.pi * tooth * h * t) / h for h in range(1, 9))
    x = x + 0.4 * np.cos(2 * np.pi * tooth * 3.5 * t) + np.random.default_rng(1).normal(scale=0.01, size=len(t))
    x[: len(t) // 4] *= 0.01
    channel = (Channel("mic", "sound_pressure", "Pa"),)
    return [SensorBlock(START + round(i * 1e9 / RATE), "daq", 1, i, RATE, channel,
                        x[i: i + ROWS, None].astype(np.float32)) for i in range(0, len(t) - ROWS + 1, ROWS)]


def axes(op: Operation, seconds: float = SECONDS) -> list[AxisState]:
    speed = op.conditions.tool_speed
    return [AxisState(START + k * 4_000_000, (0.0,) * 6, (0.0, 0.0, 0.0, 0.0, 0.6, speed * (1 + 1e-4 * np.sin(k / 9))))
            for k in range(int(seconds * 250) + 2)]


def run(feed: MonitorFeed, steps: Iterable[Step]) -> list[Verdict]:
    judged = [pair for step in steps for pair in step(feed)] + list(feed.finish())
    return [verdict for verdict, _ in judged]


def live_steps(op: Operation) -> list[Step]:
    """What arrives at a live monitor, in the order of time, predictions now and then and late."""
    timed: list[tuple[int, Step]] = [(0, lambda feed: feed.operation(START, op))]
    timed += [(b.stamp_ns + round(ROWS * 1e9 / RATE), lambda feed, b=b: feed.block(b)) for b in blocks(op)]
    timed += [(a.stamp_ns, lambda feed, a=a: feed.axes(a)) for a in axes(op)]
    for k, kind in enumerate((PredictedType.NO_CUT, PredictedType.STABLE, PredictedType.FLIP, PredictedType.HOPF)):
        prior = Prior(START + k * 400_000_000, kind, 1.0 + 0.1 * k, 700.0)
        timed.append((START + k * 400_000_000 + 333_000_000, lambda feed, prior=prior: feed.prior(prior)))
    return [step for _, step in sorted(timed, key=lambda entry: entry[0])]


def interleaved(streams: Sequence[list[Step]], seed: int) -> list[Step]:
    """Steps of several topics, each in its own order, mixed at random: one may run far ahead of another."""
    rng = random.Random(seed)
    left = [list(stream) for stream in streams if stream]
    mixed: list[Step] = []
    while left:
        chosen = rng.choice(left)
        for _ in range(min(len(chosen), rng.randint(1, 60))):
            mixed.append(chosen.pop(0))
        left = [stream for stream in left if stream]
    return mixed


@pytest.fixture(scope="module")
def live() -> list[Verdict]:
    return run(MonitorFeed(FeedSettings()), live_steps(operation()))


def test_the_live_run_uses_predictions_and_says_which(live: list[Verdict]) -> None:
    used = {verdict.prior.predicted_type for verdict in live if verdict.prior is not None}
    assert {PredictedType.STABLE, PredictedType.FLIP} <= used
    assert {ChatterKind.FLIP, ChatterKind.STABLE, ChatterKind.FLIP_OR_RUNOUT} <= {verdict.state for verdict in live}
    assert any(v.prior is None for v in live)


@pytest.mark.parametrize("seed", range(4))
def test_a_replay_gives_the_live_verdicts_however_topics_interleave(live: list[Verdict], seed: int) -> None:
    op = operation()
    steps = interleaved([
        [lambda feed: feed.operation(START, op)],
        [lambda feed, b=b: feed.block(b) for b in blocks(op)],
        [lambda feed, a=a: feed.axes(a) for a in axes(op)],
        [lambda feed, v=v: feed.recorded(v) for v in live],
        [lambda feed: feed.prior(Prior(START, PredictedType.HOPF, 9.0, 1.0))],
    ], seed)
    assert [repr(v) for v in run(MonitorFeed(FeedSettings("recorded", "recorded")), steps)] == [repr(v) for v in live]


def test_windows_whose_verdict_was_not_recorded_go_without_a_prediction(live: list[Verdict]) -> None:
    op = operation()
    kept = [v for k, v in enumerate(live) if k % 3]
    steps = interleaved([[lambda feed: feed.operation(START, op)],
                         [lambda feed, b=b: feed.block(b) for b in blocks(op)],
                         [lambda feed, a=a: feed.axes(a) for a in axes(op)],
                         [lambda feed, v=v: feed.recorded(v) for v in kept]], 7)
    again = run(MonitorFeed(FeedSettings("recorded", "recorded")), steps)
    assert [v.last_sample for v in again] == [v.last_sample for v in live]
    assert [v.prior for v in again] == [v.prior if k % 3 else None for k, v in enumerate(live)]


def test_a_live_window_does_not_wait_for_axis_states_for_ever() -> None:
    op = operation()
    feed = MonitorFeed(FeedSettings(changes={"speed_timeout": 0.5}))
    steps: list[Step] = [lambda feed: feed.operation(START, op)]
    steps += [lambda feed, b=b: feed.block(b) for b in blocks(op)]
    judged = [pair for step in steps for pair in step(feed)]
    assert judged, "windows are judged before the end although no axis state came"
    assert {v.spindle_speed_source for v, _ in judged} <= {SpeedSource.NOMINAL, SpeedSource.REFINED}
    assert feed.judged == len(blocks(op))


def test_blocks_that_come_before_the_operation_are_kept() -> None:
    op = operation()
    steps = live_steps(op)
    late = [*steps[1:200], steps[0], *steps[200:]]
    early = run(MonitorFeed(FeedSettings(prior="none")), steps)
    assert [repr(v) for v in run(MonitorFeed(FeedSettings(prior="none")), late)] == [repr(v) for v in early]


def test_an_operation_takes_over_at_its_stamp_and_the_old_one_is_judged_to_the_end() -> None:
    op = operation()
    other = parse_operation(op.text.replace("teeth: 2", "teeth: 3"), "changed")
    assert other.sha256 != op.sha256
    all_blocks = blocks(op)
    change = all_blocks[len(all_blocks) // 2].stamp_ns
    results = []
    for seed in range(3):
        feed = MonitorFeed(FeedSettings("none", "recorded"))
        steps = interleaved([[lambda feed: feed.operation(START, op), lambda feed: feed.operation(change, other)],
                             [lambda feed, b=b: feed.block(b) for b in all_blocks],
                             [lambda feed, a=a: feed.axes(a) for a in axes(op)]], seed)
        # the second operation is announced before its time, as the operation server does
        judged = [pair for step in [steps[0], *steps[1:]] for pair in step(feed)] + list(feed.finish())
        results.append([(repr(v), sha) for v, sha in judged])
    first = MonitorFeed(FeedSettings("none", "recorded"))
    ordered: list[Step] = [lambda feed: feed.operation(START, op), lambda feed: feed.operation(change, other)]
    ordered += [lambda feed, a=a: feed.axes(a) for a in axes(op)]
    ordered += [lambda feed, b=b: feed.block(b) for b in all_blocks]
    expected = [pair for step in ordered for pair in step(first)] + list(first.finish())
    hashes = [sha for _, sha in expected]
    assert hashes == sorted(hashes, key=[op.sha256, other.sha256].index)
    assert all((v.window_end_ns < change) == (sha == op.sha256) for v, sha in expected)
    assert results[0] == [(repr(v), sha) for v, sha in expected]


def test_computed_predictions_do_not_depend_on_how_topics_interleave() -> None:
    op = operation()
    plain = nominal_axes(op)
    results = []
    for seed in range(3):
        feed = MonitorFeed(FeedSettings("computed", "recorded"))
        steps = interleaved([
            [lambda feed: feed.operation(START, op)], [lambda feed, b=b: feed.block(b) for b in blocks(op)],
            [lambda feed, a=a: feed.axes(replace(plain, stamp_ns=a.stamp_ns)) for a in axes(op)]], seed)
        results.append(run(feed, steps))
    assert [[repr(v) for v in verdicts] for verdicts in results[1:]] == [[repr(v) for v in results[0]]] * 2
    expected = stability_point(op, conditions_from_axes(op, plain))
    assert {v.prior.predicted_type for v in results[0]} == {expected.predicted_type}
    assert {v.prior.spectral_radius for v in results[0]} == {expected.spectral_radius}
    assert all(0 <= v.prior.stamp_ns - v.window_end_ns <= 24_000_000 for v in results[0])


@pytest.mark.parametrize(("runout", "state", "reason"), [
    (None, ChatterKind.FLIP_OR_RUNOUT, Reason.NO_PRIOR), ("0.5 um", ChatterKind.FLIP, Reason.ABOVE_RUNOUT),
    ("60 um", ChatterKind.STABLE, Reason.KNOWN_RUNOUT)])
def test_runout_of_the_operation_decides_without_predictions_live_and_in_replay(
        runout: str | None, state: ChatterKind, reason: Reason) -> None:
    text = operation().text
    op = parse_operation(text if runout is None else text.replace("teeth: 2", f"teeth: 2\n  runout: [{runout}, 0 um]"))
    live = run(MonitorFeed(FeedSettings(prior="none")), live_steps(op))
    assert (live[-1].state, live[-1].reason, live[-1].prior) == (state, reason, None)
    again = interleaved([[lambda feed: feed.operation(START, op)],
                         [lambda feed, b=b: feed.block(b) for b in blocks(op)],
                         [lambda feed, a=a: feed.axes(a) for a in axes(op)],
                         [lambda feed, v=v: feed.recorded(v) for v in live]], 1)
    assert [repr(v) for v in run(MonitorFeed(FeedSettings("recorded", "recorded")), again)] == [repr(v) for v in live]


def test_a_nominal_cut_that_no_model_describes_tells_nothing_of_runout() -> None:
    op = operation()
    tool = replace(op.tool, runout=(1e-5, 0.0), shape=Shape(taper_angle=0.05), flute_length=math.inf)
    with pytest.raises(ValueError, match="flute length"):
        half_order_share(tapered := replace(op, tool=tool), op.conditions)
    assert math.isnan(FeedSettings().config(tapered).runout_share)
    assert math.isnan(FeedSettings().config(op).runout_share)


def test_settings_are_checked() -> None:
    with pytest.raises(ValueError, match="axes"):
        FeedSettings(prior="computed", axes="live")
    with pytest.raises(ValueError, match="prior"):
        FeedSettings(prior="guess")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="hop"):
        FeedSettings(changes={"hop": -1.0}).config(operation())


def test_after_warming_nothing_is_compiled_while_the_machine_chatters() -> None:
    """In a process of its own: a loop that is compiled during a cut costs seconds."""
    code = """
import numpy as np
from dataclasses import replace
from turnmill_core.monitoring._kernels import (drift, family, lattice, resampling, sinusoids, spectrum,
                                               synchronous)
from turnmill_ros.monitor_join import FeedSettings, MonitorFeed
from tests.test_monitor_join import RATE, ROWS, axes, blocks, operation

def compiled():
    return {(m.__name__, name): len(k.signatures)
            for m in (drift, family, lattice, resampling, sinusoids, spectrum, synchronous)
            for name, k in vars(m).items() if hasattr(k, "signatures")}

op = operation()
MonitorFeed(FeedSettings()).warm(op)
before, feed, said = compiled(), MonitorFeed(FeedSettings(prior="none")), []
feed.operation(0, op)
for k, block in enumerate(blocks(op, 1.0)):
    t = (k * ROWS + np.arange(ROWS)) / RATE
    tone = (t > 0.4) * np.cos(2 * np.pi * 787 * t) * (1 + 0.3 * np.cos(op.tooth_passing_frequency * 2 * np.pi * t))
    said += feed.block(replace(block, samples=block.samples + tone[:, None].astype(np.float32)))
for a in axes(op, 1.0):
    said += feed.axes(a)
print(said[-1][0].state.name, compiled() == before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["HOPF", "True"]


def test_warming_leaves_no_trace(live: list[Verdict]) -> None:
    feed = MonitorFeed(FeedSettings())
    feed.warm(operation())
    assert [repr(v) for v in run(feed, live_steps(operation()))] == [repr(v) for v in live]
    assert replace(feed.settings) == feed.settings
