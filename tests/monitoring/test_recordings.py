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
    family = np.array([v.chatter_family for v in hopf if len(v.chatter_family) == 3][-1])
    assert np.diff(family) == pytest.approx(165.6, abs=2)


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
