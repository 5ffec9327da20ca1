"""The monitor on recordings of real machines, with nothing but a nominal speed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from tests.monitoring.signals import blocks, watch
from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.decision import CHATTER
from turnmill_core.monitoring.verdict import ChatterKind, Verdict


def listen(path: Path, teeth: int, rpm: float) -> list[Verdict]:
    rate, samples = wavfile.read(path)
    config = ChatterConfig(teeth=teeth, nominal_speed=rpm * 2 * math.pi / 60, expect_axes=False)
    return watch(config, list(blocks(samples / 32768, float(rate), size=960)))


def test_face_mill_chatter_is_hopf_at_899_hz(recordings: Path) -> None:
    verdicts = listen(recordings / "sound/chatter_1656rpm_6teeth.wav", 6, 1656)
    in_cut = [v for v in verdicts if 2.0 < v.window_end_ns / 1e9 < 15.7]
    hopf = [v for v in in_cut if v.state is ChatterKind.HOPF]
    assert len(hopf) > 0.9 * len(in_cut)
    steady = [v.chatter_frequency for v in hopf if v.window_end_ns > 3e9]
    assert np.median(steady) == pytest.approx(899, abs=2)
    assert np.mean(np.abs(np.array(steady) - 899) < 3) > 0.95
    beside = [v for v in hopf if any(abs(abs(x - v.chatter_frequency) - 165.6) < 2 for x in v.chatter_family)]
    assert len(beside) > 0.9 * len(hopf)


@pytest.mark.parametrize("teeth", [2, 3, 4, 5, 6])
def test_no_chatter_in_the_stable_recording(recordings: Path, teeth: int) -> None:
    assert not [v for v in listen(recordings / "sound/stable_5955rpm.wav", teeth, 5955) if v.state in CHATTER]


@pytest.mark.parametrize(("teeth", "rpm"), [(2, 1656), (3, 3000), (4, 5955), (5, 8000), (6, 5955)])
def test_no_chatter_while_idle(recordings: Path, teeth: int, rpm: float) -> None:
    verdicts = listen(recordings / "sound/idle.wav", teeth, rpm)
    assert not [v for v in verdicts if v.state in CHATTER]


@pytest.mark.parametrize("rpm", [1628, 1684])
def test_face_mill_chatter_with_a_nominal_speed_1_7_percent_off(recordings: Path, rpm: float) -> None:
    verdicts = listen(recordings / "sound/chatter_1656rpm_6teeth.wav", 6, rpm)
    in_cut = [v for v in verdicts if 2.0 < v.window_end_ns / 1e9 < 15.7]
    hopf = [v for v in in_cut if v.state is ChatterKind.HOPF]
    assert len(hopf) > 0.9 * len(in_cut)
    assert np.median([v.tooth_passing_frequency for v in hopf]) == pytest.approx(165.6, rel=2e-3)


def peak(x: np.ndarray, rate: float, low: float, high: float) -> float:
    """Frequency of the strongest line between two frequencies, from one long spectrum with parabolic interpolation."""
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2
    f = np.fft.rfftfreq(len(x), 1 / rate)
    k = int(np.argmax(np.where((f > low) & (f < high), power, 0.0)))
    a, b, c = np.log(power[k - 1: k + 2])
    return float((k + 0.5 * (a - c) / (a - 2 * b + c)) * rate / len(x))


def test_speed_in_chatter_agrees_with_the_spacing_of_the_lines(recordings: Path) -> None:
    """Lines H - f_tooth and H + f_tooth of one long spectrum tell the tooth passing frequency without any comb."""
    rate, samples = wavfile.read(recordings / "sound/chatter_1656rpm_6teeth.wav")
    part = samples[4 * rate: 12 * rate, 0].astype(float)
    spacing = (peak(part, rate, 1050, 1080) - peak(part, rate, 720, 748)) / 2
    found = [v.tooth_passing_frequency for v in listen(recordings / "sound/chatter_1656rpm_6teeth.wav", 6, 1656)
             if 4.4 < v.window_end_ns / 1e9 < 12 and v.state is ChatterKind.HOPF]
    assert np.median(found) == pytest.approx(spacing, rel=1e-3)


def acceleration(folder: Path, name: str, column: int) -> tuple[np.ndarray, float]:
    table = np.genfromtxt(folder / f"acceleration/steel_x_3000rpm_{name}.csv", delimiter=",", skip_header=1)
    return table[:, column], (len(table) - 1) / (table[-1, 0] - table[0, 0])


@pytest.mark.parametrize("column", [1, 2])
def test_steel_at_a_quarter_immersion_is_stable_and_its_speed_certain(recordings: Path, column: int) -> None:
    x, rate = acceleration(recordings, "T25", column)
    config = ChatterConfig(teeth=4, nominal_speed=3000 * 2 * math.pi / 60, expect_axes=False)
    verdicts = watch(config, list(blocks(x, rate, size=32)))
    assert not [v for v in verdicts if v.state in CHATTER]
    found = [v.spindle_speed / (2 * math.pi) for v in verdicts if v.state is ChatterKind.STABLE]
    assert len(found) > 200
    part = x[round(rate): round(13 * rate)]
    assert np.median(found) == pytest.approx(peak(part, rate, 390, 410) / 8, rel=1e-3)


@pytest.mark.parametrize(("column", "longest"), [(1, 0), (2, 4)])
def test_steel_at_full_immersion_is_synchronous(recordings: Path, column: int, longest: int) -> None:
    """Feed and cross direction: at the true speed less than a tenth of the energy is not the spindle's.

    Chatter was expected there. Between entry and exit nothing is said but for 0.15 s in the cross direction.
    """
    x, rate = acceleration(recordings, "T100", column)
    config = ChatterConfig(teeth=4, nominal_speed=3000 * 2 * math.pi / 60, expect_axes=False)
    verdicts = watch(config, list(blocks(x, rate, size=32)))
    assert len([v for v in verdicts if v.state in CHATTER and 1e9 < v.window_end_ns < 13e9]) <= longest
    speed = np.median([v.spindle_speed for v in verdicts if v.state is ChatterKind.STABLE]) / (2 * math.pi)
    part = x[round(2 * rate): round(12 * rate)]
    windows = part[: len(part) // 330 * 330].reshape(-1, 330)
    t = np.arange(330) / rate
    orders = 2 * math.pi * speed * np.arange(1, int(rate / 2 / speed))
    basis = np.concatenate([np.cos(np.outer(t, orders)), np.sin(np.outer(t, orders)), np.ones((330, 1))], axis=1)
    left = windows.T - basis @ np.linalg.lstsq(basis, windows.T, rcond=None)[0]
    assert np.median(np.var(left, axis=0) / np.var(windows, axis=1)) < 0.1


def test_steel_along_the_tool_axis_at_a_quarter_immersion_is_folded_and_no_chatter(recordings: Path) -> None:
    """Its strongest line is the 13th tooth passing harmonic, folded by the rate of 1651 Hz to 703 Hz."""
    x, rate = acceleration(recordings, "T25", 3)
    config = ChatterConfig(teeth=4, nominal_speed=3000 * 2 * math.pi / 60, expect_axes=False)
    verdicts = watch(config, list(blocks(x, rate, size=32)))
    assert not [v for v in verdicts if v.state is ChatterKind.HOPF and 1.5e9 < v.window_end_ns < 12.5e9]
