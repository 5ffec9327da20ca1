"""From volts to verdict: a recording of the thesis' set-up (4.3.7.3), simulated, analysed, held against SI units."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from turnmill_core.monitoring.blocks import SensorBlock, Status
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.monitoring.verdict import ChatterKind, Reason
from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_core.operation_sensors import Sensors
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.simulation import simulate
from turnmill_ros.analysis import Analysis, analyze, timeline
from turnmill_ros.bag import check_bag
from turnmill_ros.force_compare import compare
from turnmill_ros.monitor_join import FeedSettings, MonitorFeed
from turnmill_ros.report import recording_report, tip_reader
from turnmill_ros.signals import sensor_blocks
from turnmill_ros.simulate import START_NS, simulate_to_bag

TEXT = shipped_operations()["demo_sensors"].read_text(encoding="utf-8")
OP = read_operation(shipped_operations()["demo_sensors"])
SEED = 7
SECONDS = 5.6


def judging(channel: str, text: str = TEXT) -> Operation:
    return parse_operation(text.replace("sensors:\n", f"sensors:\n  judged: {channel}\n"), f"judging {channel}")


@pytest.fixture(scope="module")
def volts(tmp_path_factory) -> Path:
    return simulate_to_bag(OP, tmp_path_factory.mktemp("volts") / "cut.mcap", duration=SECONDS, seed=SEED).path


@pytest.fixture(scope="module")
def si(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("si") / "cut.mcap"
    return simulate_to_bag(OP, path, duration=SECONDS, seed=SEED, channels=("sound", "tool_x", "tool_y")).path


@pytest.fixture(scope="module")
def heard(volts) -> Analysis:
    return analyze(volts)


def states(analysis: Analysis) -> np.ndarray:
    return np.array([v.state for v in analysis.verdicts])


def test_recording_holds_volts_of_every_sensor(volts) -> None:
    block = next(sensor_blocks(volts, replace(OP.sensors, channels=())))
    assert [c.name for c in block.channels] == [s.name for s in OP.sensors.channels]
    assert {c.unit for c in block.channels} == {"V"}
    assert check_bag(volts) == []
    probes = [k for k, s in enumerate(OP.sensors.channels) if s.kind == "fibre probe"]
    assert np.all((block.samples[:, probes] > 2.3) & (block.samples[:, probes] < 2.7))


@pytest.mark.parametrize(("channel", "same"), [("microphone", "sound"), ("tip_x", "tool_x")])
def test_verdicts_from_volts_are_those_from_si_units(volts, si, heard, channel: str, same: str) -> None:
    by_volts = heard if channel == "microphone" else analyze(volts, judging(channel))
    by_si = analyze(si, replace(OP, sensors=Sensors((replace(OP.sensors.channels[0], name=same),), judged=same)))
    assert {v.channel for v in by_volts.verdicts if v.channel} == {channel}
    assert {v.channel for v in by_si.verdicts if v.channel} == {same}
    found, expected = timeline(by_volts.segments), timeline(by_si.segments)
    assert [s.state.name for s in found] == [s.state.name for s in expected] == ["AIR", "STABLE", "HOPF"]
    assert np.mean(states(by_volts) != states(by_si)) <= 3 / 112
    assert found[2].chatter_frequency == pytest.approx(expected[2].chatter_frequency, rel=5e-4)
    truth = json.loads(volts.with_suffix(".truth.json").read_text(encoding="utf-8"))
    assert found[2].chatter_frequency == pytest.approx(truth["chatter_frequency_hz"], rel=1e-3)


def test_tip_orbit_is_within_five_percent_of_the_truth(heard) -> None:
    config = SimulationConfig(sample_rate=12800, channels=("tool_x", "tool_y"), displacement_noise=0.0, truth=False)
    chunks = simulate(OP, config, SEED, duration=SECONDS)
    true = np.concatenate([b.samples for c in chunks for b in c.blocks]).astype(np.float64)
    reader = tip_reader(heard)
    assert reader is not None
    for start, end in ((2.2, 3.2), (4.8, 5.4)):
        orbit = reader.orbit(START_NS + round(start * 1e9), START_NS + round(end * 1e9))
        assert orbit is not None
        assert orbit.round_off
        assert not orbit.saturated
        first = round((orbit.x.start_ns - START_NS) * 12800e-9)
        expected = true[first: first + len(orbit.turns)]
        found = np.stack([orbit.x.samples, orbit.y.samples], axis=1)
        error = np.sqrt(np.mean(np.sum((found - expected) ** 2, axis=1)))
        assert error < 0.05 * np.sqrt(np.sum(expected.var(axis=0)))
        assert len(orbit.once()) == pytest.approx((end - start) * 3025 / 60, abs=1)
        assert orbit.turns[0] == pytest.approx((orbit.x.start_ns - START_NS) * 1e-9 * 3025 / 60, abs=1e-6)


def test_forces_in_volts_are_compared_with_the_model(volts) -> None:
    (source, windows), = compare(volts).windows.items()
    assert source.components == (0, 1)
    stable = [w for w in windows if w.reason == ""][:4]
    assert stable[-1].scale == pytest.approx(1.0, abs=0.01)


def narrow() -> Operation:
    """The operation with probes that saturate beyond +-34 um."""
    text = TEXT.replace("lowest: 0.5 V", "lowest: 2.3 V").replace("highest: 4.5 V", "highest: 2.7 V")
    assert text.count("lowest: 2.3 V") == text.count("highest: 2.7 V") == 4
    return parse_operation(text, "narrow")


def test_saturation_is_flagged_in_its_block_and_stops_the_verdict_on_the_tip(volts, tmp_path) -> None:
    op = narrow()
    path = simulate_to_bag(op, tmp_path / "narrow.mcap", duration=4.9, seed=SEED).path
    first = None
    for wide, block in zip(sensor_blocks(volts, replace(OP.sensors, channels=())), sensor_blocks(path, op.sensors),
                           strict=False):
        for k, sensor in enumerate(op.sensors.channels):
            beyond = np.any((wide.samples[:, k] <= np.float32(sensor.lowest))
                            | (wide.samples[:, k] >= np.float32(sensor.highest)))
            assert bool(block.channels[k].status & Status.SATURATED) is bool(beyond)
            if beyond and sensor.name.endswith("_x") and first is None:
                first = block.stamp_ns
    assert first is not None
    assert (first - START_NS) * 1e-9 > 3.5
    analysis = analyze(path, judging("tip_x", op.text))
    told = [v for v in analysis.verdicts if v.reason is Reason.SATURATED]
    assert told[0].state is ChatterKind.UNKNOWN
    assert first <= told[0].window_end_ns <= first + 20_000_000 + 50_000_000
    assert all(v.reason is Reason.SATURATED for v in analysis.verdicts if v.window_end_ns > told[0].window_end_ns)
    found = [f for f in check_bag(path) if "low_x" in f.text]
    assert [f.code for f in found] == ["saturated"]
    assert found[0].time_s == pytest.approx((first - START_NS) * 1e-9, abs=1e-6)
    reader = tip_reader(analysis)
    assert reader is not None
    spoilt, fine = (reader.orbit(START_NS + round(t * 1e9), START_NS + round((t + 0.5) * 1e9)) for t in (4.3, 2.5))
    assert (spoilt.saturated, fine.saturated) == (True, False)


def judged(op: Operation, blocks: list[SensorBlock], axes: list) -> list:
    feed = MonitorFeed(FeedSettings(prior="none", axes="recorded"))
    found = list(feed.operation(0, op))
    for state in axes:
        found += feed.axes(state)
    for block in blocks:
        found += feed.block(block)
    return [v for v, _ in [*found, *feed.finish()]]


@pytest.fixture(scope="module")
def cut():
    """Blocks in volts and axis states of air and a stable cut."""
    chunks = list(simulate(OP, SimulationConfig(volts=True, truth=False), SEED, duration=2.4))
    return [b for c in chunks for b in c.blocks], [a for c in chunks for a in c.axes]


def test_tip_does_not_depend_on_block_size(cut) -> None:
    blocks, axes = cut
    op = judging("tip_x")
    expected = judged(op, blocks, axes)
    samples = np.concatenate([b.samples for b in blocks])
    edges = [0, 1, 100, 5000, 5001, 17000, 17100, len(samples)]
    again = [replace(blocks[0], stamp_ns=round(a / 12800 * 1e9), first_sample=a, samples=samples[a:b].copy())
             for a, b in pairwise(edges)]
    found = judged(op, again, axes)
    assert [(v.last_sample, v.state, v.level, v.asynchronous_ratio) for v in found] == [
        (v.last_sample, v.state, v.level, v.asynchronous_ratio) for v in expected]


def test_runout_is_learned_in_air_and_needs_the_tools_angle(cut) -> None:
    blocks, axes = cut
    op = judging("tip_x")
    level = {v.last_sample: v.level for v in judged(op, blocks, axes)}
    blind = {v.last_sample: v.level for v in judged(
        op, blocks, [replace(a, position=(*a.position[:5], float("nan"))) for a in axes])}
    air = [k for k in level if 0.8 * 12800 < k < 1.4 * 12800]
    assert max(level[k] for k in air) < 5e-7 < 5e-6 < min(blind[k] for k in air)
    still = judged(op, blocks, [replace(a, position=(*a.position[:5], a.position[5] + 0.7)) for a in axes])
    assert [v.state for v in still] == [v.state for v in judged(op, blocks, axes)]


def test_shank_far_from_round_is_air_in_air() -> None:
    op = parse_operation(judging("tip_x").text.replace("[12 um, 3 um, 1 um]", "[48 um, 12 um, 4 um]"), "bent")
    chunks = list(simulate(op, SimulationConfig(volts=True, truth=False), SEED, duration=2.4))
    verdicts = judged(op, [b for c in chunks for b in c.blocks], [a for c in chunks for a in c.axes])
    assert {v.state for v in verdicts if 0.2 < v.last_sample / 12800 < 1.5} == {ChatterKind.AIR}
    assert verdicts[-1].state is ChatterKind.STABLE


@pytest.mark.parametrize(("channel", "value", "reason", "text"), [
    ("low_x", np.nan, Reason.BAD_SAMPLES, "no numbers"),
    ("high_x", 12.0, Reason.SATURATED, "high_x is saturated"),
    ("microphone", 12.0, Reason.BELOW_NOISE, ""),
])
def test_volts_that_cannot_be_are_told_on_arrival(cut, channel: str, value: float, reason: Reason, text: str) -> None:
    blocks, axes = cut
    column = [c.name for c in blocks[0].channels].index(channel)
    samples = blocks[60].samples.copy()
    samples[10, column] = value
    verdicts = judged(judging("tip_x"), [*blocks[:60], replace(blocks[60], samples=samples), *blocks[61:]], axes)
    told = [v for v in verdicts if 60 * 256 <= v.last_sample < 60 * 256 + 0.2 * 12800]
    assert {v.reason for v in told if v.last_sample >= 60 * 256 + 10 + 256} >= {reason}
    assert any(text in v.reason_text for v in told)


@pytest.mark.parametrize(("changes", "text"), [
    ({"unit": "m", "quantity": "displacement"}, "is beyond 0.01"),
    ({"name": "other"}, "needs channel 'low_x'"),
])
def test_wrong_units_and_missing_probes_are_told(cut, changes, text: str) -> None:
    blocks, axes = cut
    wrong = [replace(b, channels=tuple(replace(c, **changes) if c.name == "low_x" else c for c in b.channels))
             for b in blocks[:40]]
    verdicts = judged(judging("tip_x"), wrong, axes)
    assert {v.state for v in verdicts} == {ChatterKind.UNKNOWN}
    assert text in verdicts[-1].reason_text
    assert calibrate(OP.sensors, wrong[0]).channels[0].unit == "Pa"


def test_tip_without_probes_is_told_or_falls_back(cut) -> None:
    blocks, _ = cut
    op = replace(OP, sensors=Sensors(OP.sensors.channels[:1]))
    for fallback, channels in ((False, {"tip_x"}), (True, {"microphone"})):
        feed = MonitorFeed(FeedSettings(prior="none", axes="none", changes={"channel": "tip_x", "fallback": fallback}))
        found = [*feed.operation(0, op)]
        for block in blocks[:40]:
            found += feed.block(block)
        last = [v for v, _ in found][-1]
        assert {last.channel} == channels
        assert ("no fibre probe looks along x" in last.reason_text) is not fallback


def test_report_shows_the_orbit_of_every_state(heard, tmp_path) -> None:
    recording_report(tmp_path / "a.html", heard)
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "Tool tip" in page
    assert "STABLE: last 10 of 50 revolutions" in page
    assert "HOPF: last 10 of" in page
    assert "microphone (sound pressure" in page
    bare = replace(heard, operation=replace(OP, sensors=replace(OP.sensors, channels=(), fixture=None)))
    assert tip_reader(bare) is None
