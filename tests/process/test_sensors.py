"""Filter, noise, and the sound model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.process.cases import SILENT, milling, run
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Mode
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.sensors import SoundModel, Tone, ambient_sound, antialias_taps, white_noise
from turnmill_core.process.simulation import initial, step


@pytest.mark.parametrize("ratio", [2, 3, 8, 20])
def test_the_filter_lets_through_and_stops_what_it_says(ratio: int) -> None:
    taps = antialias_taps(ratio)
    f = np.linspace(0, 0.5, 20_001)  # cycles per integration step
    gain = np.abs(np.fft.rfft(taps, 40_000))
    np.testing.assert_allclose(gain[f < 0.4 / ratio], 1, atol=3e-4)
    assert 20 * np.log10(gain[f > 0.6 / ratio].max()) < -80
    np.testing.assert_array_equal(taps, taps[::-1])


def test_no_filter_without_decimation() -> None:
    assert antialias_taps(1).tolist() == [1.0]


def test_noise_is_white_and_can_be_cut_anywhere() -> None:
    noise = white_noise(3, 2, 500, 60_000)
    assert noise.std() == pytest.approx(1, abs=0.02)
    assert np.abs(np.correlate(noise, noise[1000:-1000], "valid")[[0, 400, 900]] / len(noise)).max() < 0.03
    np.testing.assert_array_equal(noise[1234:9876], white_noise(3, 2, 500 + 1234, 9876 - 1234))
    assert not np.any(noise[:100] == white_noise(3, 1, 500, 100))
    assert len(white_noise(3, 2, 1024, 0)) == 0


def test_background_has_its_level_and_tones_their_frequency() -> None:
    model = SoundModel(background=0.02, tones=(Tone(0.1, order=2.0), Tone(0.05, frequency=100.0)))
    t = np.arange(51_200) / 51_200
    sound, _ = ambient_sound(model, 1, 0, 51_200.0, 2 * math.pi * 30 * t, 0.0)
    spectrum = 2 * np.abs(np.fft.rfft(sound)) / len(sound)
    assert spectrum[60] == pytest.approx(0.1, rel=0.05)
    assert spectrum[100] == pytest.approx(0.05, rel=0.05)
    quiet, _ = ambient_sound(SoundModel(background=0.02, tones=()), 1, 0, 51_200.0, t, 0.0)
    assert quiet.std() == pytest.approx(0.02, rel=0.1)


def test_sound_is_that_of_a_piston() -> None:
    """A mode that rings in the air: p = rho S a / (2 pi d) times the direction's cosine."""
    mode = Mode(1000.0, 1e-6, 0.5, (0.0, 1.0, 0.0))
    op = milling((mode,), depth=-1e-3)
    sound = SoundModel(distance=0.7, direction=(0.6, 0.8, 0.0), tool_area=0.01, panels=(), background=0.0, tones=())
    config = SimulationConfig(sample_rate=51_200, channels=("sound", "tool_y"), displacement_noise=0.0, sound=sound)
    state = initial(op, config, 0, np.array([[2e-6, 0.0]]))
    state, chunk = step(config, state, [axis_state_at(op, t, round(t * 1e9)) for t in (0.0, 0.1)])
    found = np.concatenate([b.samples for b in chunk.blocks])[200:-200]
    pressure = 1.204 * 0.01 / (2 * math.pi * 0.7) * 0.8 * 2e-6 * (2 * math.pi * 1000) ** 2
    assert np.abs(found[:, 1]).max() == pytest.approx(2e-6, rel=1e-2)
    assert np.abs(found[:, 0]).max() == pytest.approx(pressure, rel=1e-2)
    assert np.corrcoef(found.T)[0, 1] == pytest.approx(-1, abs=1e-3)


def test_panels_ring_with_every_tooth_and_do_not_touch_the_cut() -> None:
    op = milling(depth=2e-4)
    heard = SoundModel(panels=SoundModel().panels, tool_area=0.0, background=0.0, tones=())
    config = SimulationConfig(sample_rate=51_200, channels=("sound", "tool_x"), displacement_noise=0.0, sound=heard)
    deaf = SimulationConfig(sample_rate=51_200, channels=("sound", "tool_x"), displacement_noise=0.0, sound=SILENT)
    loud, quiet = run(op, config, 0.2), run(op, deaf, 0.2)
    assert loud[-5000:, 0].std() > 1e-4
    np.testing.assert_array_equal(loud[:, 1], quiet[:, 1])


@pytest.mark.parametrize(("wrong", "message"), [
    ({"distance": 0.0}, "distance"), ({"background_corner": 0.0}, "corner"), ({"background": -1.0}, "background"),
    ({"tool_area": -1.0}, "tool area"), ({"panel_area": -1.0}, "panel area"),
])
def test_wrong_sound_models_are_named(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SoundModel(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [{"amplitude": 1.0}, {"amplitude": 1.0, "order": 1.0, "frequency": 1.0},
                                   {"amplitude": -1.0, "order": 1.0}])
def test_wrong_tones_are_named(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="tone"):
        Tone(**wrong)
