"""Volts of simulated sensors: what each of them sees of the cut, noise, clipping, and any way of cutting it up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_sensors import TYPICAL_NOISE, Sensor, Sensors
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.simulation import initial, simulate, step
from turnmill_core.process.volts import casing_motion, out_of_roundness

OP = read_operation(shipped_operations()["demo_sensors"])
RATE = 12800
SECONDS = 2.4
TRUE = ("sound", "tool_x", "tool_y", "force_x", "force_y", "tool_velocity_y")
CONFIG = SimulationConfig(sample_rate=RATE, channels=TRUE, truth=False, displacement_noise=0.0, force_noise=0.0)


def samples(op, config: SimulationConfig, seconds: float = SECONDS) -> np.ndarray:
    return np.concatenate([b.samples for c in simulate(op, config, 3, duration=seconds) for b in c.blocks])


@pytest.fixture(scope="module")
def cut():
    """Calibrated values (n,) by sensor, and the true signals by name: air, then a cut."""
    blocks = [b for c in simulate(OP, replace(CONFIG, volts=True), 3, duration=SECONDS) for b in c.blocks]
    assert {(c.quantity, c.unit) for b in blocks for c in b.channels} == {("voltage", "V")}
    found = np.concatenate([calibrate(OP.sensors, b).samples for b in blocks]).astype(np.float64)
    true = samples(OP, CONFIG).astype(np.float64)
    return dict(zip([s.name for s in OP.sensors.channels], found.T, strict=True)), dict(zip(TRUE, true.T, strict=True))


def noise(name: str) -> float:
    sensor = next(s for s in OP.sensors.channels if s.name == name)
    return sensor.noise_rms / abs(sensor.sensitivity)


@pytest.mark.parametrize(("name", "true"), [("microphone", "sound"), ("force_x", "force_x"), ("force_y", "force_y")])
def test_microphone_and_dynamometer_see_the_signal_and_their_noise(cut, name: str, true: str) -> None:
    found, signals = cut
    left = found[name] - signals[true]
    assert left.std() == pytest.approx(noise(name), rel=0.05)
    assert noise(name) == TYPICAL_NOISE["microphone" if name == "microphone" else "dynamometer"]
    assert np.abs(signals[true]).max() > 100 * noise(name)


def test_accelerometer_sees_the_change_of_the_velocity(cut) -> None:
    found, signals = cut
    sensor = next(s for s in OP.sensors.channels if s.kind == "accelerometer")
    integrated = np.cumsum(found["spindle_y"]) / RATE / sensor.shape
    at = np.arange(len(integrated)) / RATE > 2.0
    band = np.fft.rfftfreq(at.sum(), 1 / RATE)
    a, v = (np.fft.rfft(x[at] * np.hanning(at.sum())) for x in (integrated, signals["tool_velocity_y"]))
    tooth = [int(np.argmin(np.abs(band - k * OP.tooth_passing_frequency))) for k in (1, 2, 5, 8)]
    assert np.abs(a[tooth]) == pytest.approx(np.abs(v[tooth]), rel=0.02)


def test_probe_sees_shank_runout_and_casing(cut) -> None:
    found, signals = cut
    turns = np.arange(len(found["low_x"])) / RATE * OP.conditions.tool_speed
    for sensor in OP.sensors.channels:
        if sensor.kind != "fibre probe":
            continue
        axis = sensor.direction
        casing, _ = casing_motion(OP.sensors.fixture, signals[f"force_{axis}"], RATE)
        expected = sensor.shape * signals[f"tool_{axis}"] - casing + out_of_roundness(sensor, turns)
        left = found[sensor.name] - expected
        assert left.std() == pytest.approx(noise(sensor.name), rel=0.1)
        assert abs(left.mean()) < 1e-8


def test_shank_is_one_body_for_both_directions() -> None:
    x = Sensor("x", "fibre probe", 1.0, -1.0, 1.0, direction="x", runout=(3e-6, 1e-6))
    angle = np.linspace(0, 4 * math.pi, 400)
    assert out_of_roundness(x, angle + math.pi / 2) == pytest.approx(
        out_of_roundness(replace(x, direction="y"), angle), abs=1e-18)
    assert out_of_roundness(x, np.array([math.pi / 2]))[0] == pytest.approx(4e-6)


def test_volts_stay_in_the_range_of_each_sensor() -> None:
    narrow = tuple(replace(s, lowest=s.offset - 0.05, highest=s.offset + 0.05) if s.kind == "fibre probe" else s
                   for s in OP.sensors.channels)
    config = replace(CONFIG, volts=True)
    wide = samples(OP, config, 0.4)
    found = samples(replace(OP, sensors=replace(OP.sensors, channels=narrow)), config, 0.4)
    low, high = (np.array([getattr(s, end) for s in narrow], dtype=np.float32) for end in ("lowest", "highest"))
    assert np.array_equal(found, np.clip(wide, low, high))
    assert (found == low).any()
    assert (found == high).any()


def test_volts_do_not_depend_on_how_axis_states_are_cut() -> None:
    config = replace(CONFIG, volts=True, axes_rate=1000.0)
    axes = [axis_state_at(OP, k * 1e-3, k * 1_000_000) for k in range(1700, 1900)]
    whole, one = step(config, initial(OP, config, 5), axes)
    state, parts = initial(OP, config, 5), []
    for cut in (axes[:1], axes[1:2], axes[2:60], axes[60:131], axes[131:]):
        state, chunk = step(config, state, cut)
        parts += [b.samples for b in chunk.blocks]
    assert np.array_equal(np.concatenate(parts), np.concatenate([b.samples for b in one.blocks]))
    assert np.array_equal(state.samples, whole.samples)


def test_without_sensors_nothing_changes() -> None:
    bare = replace(OP, sensors=Sensors())
    assert np.array_equal(samples(bare, CONFIG, 0.3), samples(bare, replace(CONFIG, volts=True), 0.3))
