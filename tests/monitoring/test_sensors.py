"""Sensors: calibration, saturation, plausibility; the tool tip from pairs of probes on the shank."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.monitoring.signals import watch
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.chatter import ChatterConfig, config_from_operation
from turnmill_core.monitoring.sensors import (
    calibrate,
    implausible,
    low_orders,
    shank_runout,
    tip_motion,
    without_runout,
)
from turnmill_core.monitoring.verdict import Reason
from turnmill_core.operation_file import describe, parse_operation, shipped_operations
from turnmill_core.operation_sensors import Fixture, Sensor, Sensors
from turnmill_core.process.sensors import SoundModel
from turnmill_core.process.simulation import SimulationConfig, simulate
from turnmill_core.process.volts import casing_motion, measure, probe_sees

RATE = 12800.0
SECTION = """
sensors:
  fixture: {frequency: 80 Hz, damping: 6 %, cross_talk: 0.02 um/N}
  channels:
    - {name: low_x, kind: fibre probe, direction: x, sensitivity: 5.8 mV/um, shape: 62 %,
       offset: 2.5 V, lowest: 0.5 V, highest: 4.5 V}
    - {name: high_x, kind: fibre probe, direction: x, sensitivity: -5.8 mV/um, shape: 35 %,
       offset: 2.5 V, lowest: 0.5 V, highest: 4.5 V}
    - {name: low_y, kind: fibre probe, direction: y, sensitivity: 5.8 mV/um, shape: 62 %,
       offset: 2.5 V, lowest: 0.5 V, highest: 4.5 V}
    - {name: high_y, kind: fibre probe, direction: y, sensitivity: -5.8 mV/um, shape: 35 %,
       offset: 2.5 V, lowest: 0.5 V, highest: 4.5 V}
    - {name: mic, kind: microphone, sensitivity: 50 mV/Pa, lowest: -5 V, highest: 5 V}
    - {name: spindle, kind: accelerometer, sensitivity: 10.2 mV*s^2/m, lowest: -5 V, highest: 5 V}
    - {name: table_x, kind: dynamometer, sensitivity: 2 mV/N, lowest: -10 V, highest: 10 V}
"""


def operation(text: str = SECTION):
    shipped = shipped_operations()["demo_turn_milling"].read_text(encoding="utf-8")
    return parse_operation(shipped + text, "demo with sensors")


def block(volts: np.ndarray, names: list[str], first: int = 0, quantity: str = "voltage",
          unit: str = "V") -> SensorBlock:
    return SensorBlock(round(first * 1e9 / RATE), "daq", 1, first, RATE,
                       tuple(Channel(n, quantity, unit) for n in names), np.asarray(volts, dtype=np.float32))


def test_operation_file_holds_the_sensors() -> None:
    op = operation()
    assert op.sensors.fixture == Fixture(80.0, 0.06, 0.02 * 1e-6)
    low, high, *_, mic, spindle, table = op.sensors.channels
    assert low == Sensor("low_x", "fibre probe", low.sensitivity, 0.5, 4.5, 2.5, "x", 0.62)
    assert low.sensitivity == pytest.approx(5800.0)
    assert high.sensitivity == pytest.approx(-5800.0)
    assert (mic.sensitivity, spindle.sensitivity, table.sensitivity) == pytest.approx((0.05, 0.0102, 0.002))
    assert config_from_operation(op).sensors == op.sensors
    assert any("5.8 mV/um" in value for title, rows in describe(op) if title == "sensors" for _, value in rows)


@pytest.mark.parametrize(("old", "new", "told"), [
    ("5.8 mV/um, shape: 62 %", "5.8 mV, shape: 62 %", "sensitivity"),
    ("name: high_x", "name: low_x", "each name once"),
    ("lowest: -10 V", "lowest: 11 V", "highest"),
    ("kind: microphone", "kind: ear", "microphone"),
    ("kind: dynamometer", "kind: dynamometer, shape: 20 %", "nothing else but an accelerometer"),
    ("kind: microphone", "kind: microphone, runout: [1 um]", "fibre probe only"),
    ("shape: 62 %", "shape: 62 %, noise: -1 mV", "voltage >= 0"),
    ("  fixture:", "  judged: tip\n  fixture:", "judged"),
])
def test_bad_sections_are_refused(old: str, new: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        operation(SECTION.replace(old, new, 1))


def test_calibration_gives_back_what_was_measured() -> None:
    sensors = operation().sensors
    values = np.linspace(-3e-4, 3e-4, 64)
    volts = np.stack([measure(sensors.channels[0], values), measure(sensors.channels[1], values), np.zeros(64)], axis=1)
    found = calibrate(sensors, block(volts, ["low_x", "high_x", "unknown"]))
    assert found.samples[:, 0] == pytest.approx(values, abs=1e-9)
    assert found.samples[:, 1] == pytest.approx(values, abs=1e-9)
    assert [(c.quantity, c.unit) for c in found.channels] == [
        ("displacement", "m"), ("displacement", "m"), ("voltage", "V")]
    assert [c.status for c in found.channels] == [Status.OK, Status.OK, Status.UNCALIBRATED]
    si = block(volts, ["low_x", "high_x", "unknown"], quantity="displacement", unit="m")
    assert calibrate(sensors, si) is si


@pytest.mark.parametrize("end", [0.1, 0.3, 0.7, 4.7])
def test_the_ends_of_the_range_are_saturated_whatever_their_rounding(end: float) -> None:
    for sensor in (Sensor("a", "microphone", 1.0, end, 9.0, 5.0), Sensor("a", "microphone", 1.0, -9.0, end, -5.0)):
        for value, flagged in ((end, True), ((sensor.lowest + sensor.highest) / 2, False)):
            found = calibrate(Sensors((sensor,)), block(np.full((3, 1), value), ["a"]))
            assert bool(found.channels[0].status & Status.SATURATED) is flagged
    assert calibrate(Sensors((sensor,)), block(np.zeros((0, 1)), ["a"])).channels[0].status is Status.OK


def test_saturation_is_flagged_in_its_block_and_told_by_the_monitor() -> None:
    sensors = operation().sensors
    t = np.arange(25600) / RATE
    x = 1e-4 * np.sin(2 * math.pi * 200 * t)
    at = 16384
    x[at: at + 3] = 5e-4
    volts = measure(sensors.channels[0], x)[:, None]
    blocks = [block(volts[k: k + 256], ["low_x"], k) for k in range(0, len(volts), 256)]
    flags = [bool(calibrate(sensors, b).channels[0].status & Status.SATURATED) for b in blocks]
    assert [k for k, flag in enumerate(flags) if flag] == [at // 256]
    config = ChatterConfig(teeth=4, nominal_speed=50 * 2 * math.pi, expect_axes=False, sensors=sensors)
    told = [v for v in watch(config, blocks) if v.reason is Reason.SATURATED]
    assert told
    assert all(v.window_start_ns < (at + 256) * 1e9 / RATE and v.window_end_ns >= (at - 256) * 1e9 / RATE for v in told)
    assert told[0].window_end_ns <= (at + 256) * 1e9 / RATE + 5e7


def test_values_no_sensor_can_measure_are_told() -> None:
    assert implausible(Channel("x", "displacement", "m"), -0.001, 0.002) == ""
    assert "unit" in implausible(Channel("x", "displacement", "m"), -30.0, 20.0)
    assert implausible(Channel("x", "sound", "1"), -30000.0, 20000.0) == ""
    x = 40 * np.sin(np.arange(12800) * 0.1)[:, None]
    config = ChatterConfig(teeth=4, nominal_speed=50 * 2 * math.pi, expect_axes=False)
    verdicts = watch(config, [block(x[k: k + 256], ["x"], k, "displacement", "m") for k in range(0, 12800, 256)])
    assert verdicts[-1].reason is Reason.BAD_SAMPLES
    assert "is beyond 0.01" in verdicts[-1].reason_text


def test_casing_moves_like_its_mode() -> None:
    fixture = Fixture(80.0, 0.06, 2e-8)
    t = np.arange(40000) / RATE
    slow, _ = casing_motion(fixture, np.full(len(t), 100.0), RATE)
    assert slow[-1] == pytest.approx(100 * 2e-8, rel=1e-3)
    for f in (40.0, 80.0, 300.0):
        force = 100 * np.cos(2 * math.pi * f * t)
        whole, _ = casing_motion(fixture, force, RATE)
        first, state = casing_motion(fixture, force[:5000], RATE)
        rest, _ = casing_motion(fixture, force[5000:], RATE, state)
        assert np.array_equal(np.concatenate([first, rest]), whole)
        found = whole[-12800:]
        r = f / 80.0
        expected = 100 * 2e-8 / math.hypot(1 - r**2, 2 * 0.06 * r)
        assert found.std() * math.sqrt(2) == pytest.approx(expected, rel=5e-3)


@pytest.fixture(scope="module")
def cut():
    """Tip motion (n, 2), cutting force (n, 2) and revolutions of the demo's cut, air first; and its operation."""
    op = operation()
    config = SimulationConfig(sample_rate=round(RATE), channels=("tool_x", "tool_y", "force_x", "force_y"),
                              displacement_noise=0.0, force_noise=0.0, truth=False, sound=SoundModel(panels=()))
    x = np.concatenate([b.samples for c in simulate(op, config, 1, duration=2.5) for b in c.blocks]).astype(np.float64)
    turns = np.arange(len(x)) / RATE * op.schedule[0].tool_speed / (2 * math.pi)
    return op, x[:, :2], x[:, 2:], turns


def probes_see(op, tip, force, turns, gain: float = 1.0):
    """Volts of the four probes: out-of-round shank, 80 Hz casing, 50 nm of noise; and the casing's motion."""
    rng = np.random.default_rng(5)
    casing = np.stack([casing_motion(op.sensors.fixture, force[:, k], RATE)[0] for k in range(2)], axis=1)
    volts = []
    for k, sensor in enumerate(op.sensors.channels[:4]):
        axis = k // 2
        runout = 12e-6 * np.cos(2 * math.pi * turns + k) + 3e-6 * np.cos(4 * math.pi * turns + 2 * k)
        seen = probe_sees(sensor, gain * tip[:, axis], runout, casing[:, axis]) + 5e-8 * rng.standard_normal(len(tip))
        volts.append(measure(sensor, seen))
    return np.stack(volts, axis=1), casing


def test_tip_orbit_from_probe_pairs_with_runout_and_cross_talk(cut) -> None:
    op, tip, force, turns = cut
    volts, casing = probes_see(op, tip, force, turns)
    names = [s.name for s in op.sensors.channels[:4]]
    seen = calibrate(op.sensors, block(volts, names)).samples.astype(np.float64)
    air = slice(0, round(0.8 * RATE))
    seen = without_runout(seen, turns, shank_runout(seen[air], turns[air]))
    pairs = [tip_motion(op.sensors, axis, seen[:, 2 * k: 2 * k + 2], RATE) for k, axis in enumerate("xy")]
    found, shook = (np.stack([pair[k] for pair in pairs], axis=1) for k in range(2))
    in_cut = slice(round(1.6 * RATE), None)
    assert casing[in_cut].std() > 0.05 * tip[in_cut].std()
    error = np.linalg.norm(found[in_cut] - tip[in_cut], axis=1)
    size = np.linalg.norm(tip[in_cut] - tip[in_cut].mean(axis=0), axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(size**2))
    assert np.sqrt(np.mean((shook - casing)[in_cut] ** 2)) < 0.2 * casing[in_cut].std() + 2e-7
    rigid = Sensors(op.sensors.channels)
    alone, _ = tip_motion(rigid, "x", seen[:, :2], RATE)
    assert np.linalg.norm(alone[in_cut] - tip[in_cut, 0]) > np.linalg.norm((found - tip)[in_cut, 0])
    with pytest.raises(ValueError, match="4 whole ones"):
        shank_runout(seen[: round(0.05 * RATE)], turns[: round(0.05 * RATE)])


def test_saturated_probes_are_flagged_where_the_orbit_is_wrong(cut) -> None:
    op, tip, force, turns = cut
    gain = 6e-4 / np.abs(tip[round(1.6 * RATE):]).max()
    volts, _ = probes_see(op, tip, force, turns, gain)
    names = [s.name for s in op.sensors.channels[:4]]
    flags = [calibrate(op.sensors, block(volts[k: k + 256], names, k)).channels for k in range(0, len(volts), 256)]
    for k, channels in enumerate(flags):
        part = volts[256 * k: 256 * k + 256]
        for column, channel in enumerate(channels):
            beyond = bool(((part[:, column] <= 0.5) | (part[:, column] >= 4.5)).any())
            assert bool(channel.status & Status.SATURATED) is beyond
    assert any(c.status & Status.SATURATED for channels in flags for c in channels)


def test_probes_that_cannot_tell_are_refused() -> None:
    probe = Sensor("a", "fibre probe", 5800.0, 0.5, 4.5, 2.5, "x", 0.5)
    with pytest.raises(ValueError, match="along y"):
        tip_motion(Sensors((probe,)), "y", np.zeros((4, 1)), RATE)
    same = Sensors((probe, replace(probe, name="b")), Fixture(80.0, 0.06, 2e-8))
    with pytest.raises(ValueError, match="differ by 5 %"):
        tip_motion(same, "x", np.zeros((4, 2)), RATE)
    with pytest.raises(ValueError, match="each name once"):
        Sensors((probe, probe))
    with pytest.raises(ValueError, match="found from the fibre probes"):
        replace(probe, name="tip_x")
    with pytest.raises(ValueError, match="judged sensor is 'b'"):
        Sensors((probe,), judged="b")
    with pytest.raises(ValueError, match="along y"):
        Sensors((probe,), judged="tip_y")
    assert Sensors((probe,), judged="tip_x").probes("x") == (probe,)


def test_low_orders_are_those_of_an_out_of_round_shank() -> None:
    turns = np.linspace(3.3, 13.1, 3000)
    low = 5e-5 * np.cos(2 * math.pi * turns + 1) + 2e-6 * np.sin(10 * math.pi * turns) + 1e-3
    high = 1e-6 * np.cos(2 * math.pi * 13 * turns)
    table = low_orders(shank_runout((low + high)[:, None], turns), 5)
    assert without_runout((low + high)[:, None], turns, table)[:, 0] == pytest.approx(high, abs=2e-8)
