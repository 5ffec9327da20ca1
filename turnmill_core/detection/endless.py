"""Hours of signal without chatter: the settled motion of a stable cut goes on as long as it is wanted.

What a stable cut settles to repeats with every revolution of the tool. One revolution of it, averaged over the end of a
simulated cut, is laid along the true angle of a spindle that wanders; the tool enters, cuts with slowly varying
strength, leaves and enters again; noise, tones, coolant and the tachometer are those of every other case.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from turnmill_core.detection.cuts import AIR_SECONDS, ENTRY_SECONDS, generator, make_cut
from turnmill_core.detection.recordings import (
    RATE,
    SENSED,
    TACHOMETER_HZ,
    Motion,
    Observed,
    ambient,
    noisy_others,
    simulate_cut,
)
from turnmill_core.monitoring.chatter import SpindleSpeed
from turnmill_core.process.sensors import CHANNELS
from turnmill_core.process.truth import join_truth

Floats = NDArray[np.float64]

SECONDS = 60.0
QUIET_KINDS = ("stable", "resonance", "runout", "air")
TABLE = 8192
SETTLED = AIR_SECONDS + ENTRY_SECONDS + 0.2
HELD_UNTIL = AIR_SECONDS + ENTRY_SECONDS + 0.8
LARGEST_RATIO = 0.05
TRIED = 100
"""Cuts looked through for a quiet one; quiet signals with numbers below TRAIN_END / TRIED serve to develop."""


def quiet_motion(kind: str, number: int) -> Motion:
    """Motion of the first stable cut from `number` * TRIED on whose attractor repeats with the revolution.

    kind: of QUIET_KINDS; "air" takes the sounds of a stable cut's machine.
    """
    for k in range(TRIED * number, TRIED * (number + 1)):
        cut = make_cut("stable" if kind == "air" else kind, k)
        if cut.margin.spectral_radius < 0.9:
            motion = simulate_cut(cut)
            with np.errstate(invalid="ignore"):
                ratio = motion.truth.ratio[(motion.truth.time > SETTLED) & (motion.truth.time < HELD_UNTIL)]
            if len(ratio) and np.nanmax(ratio) < LARGEST_RATIO:
                return motion
    raise ValueError(f"no quiet cut of kind {kind} was found for number {number}")


def go_on(motion: Motion, kind: str, number: int, part: int, seconds: float = SECONDS,
          extra_error: float = 0.0) -> Observed:
    """`seconds` [s] of the signal that a quiet motion would go on to make.

    part: which of many; extra_error: relative error of the tachometer beyond the drawn one.
    """
    cut = motion.cut
    rng = generator(kind, number, f"endless {part}")
    name = str(rng.choice(SENSED))
    speed = cut.operation.conditions.tool_speed / (2 * math.pi)
    count = round(seconds * RATE)
    wander = 1 + 1e-3 * coloured_slow(rng, count, 0.3)
    turns = np.concatenate([[0.0], np.cumsum(speed * wander)[:-1] / RATE])
    envelope = np.zeros(count) if kind == "air" else _passes(rng, count)
    strength = envelope * (1 + 0.08 * coloured_slow(rng, count, 2.0))
    waves = {n: _revolution(motion, n, speed) for n in SENSED}
    clean = {n: _along(wave, turns) * strength for n, wave in waves.items()}
    levels = {n: float(wave.std()) for n, wave in waves.items()}
    noise = ambient(rng, name, count, turns, levels[name])
    error = float(rng.choice([0.0, rng.uniform(-2e-3, 2e-3)])) + extra_error
    at = np.arange(0, count, RATE / TACHOMETER_HZ)
    measured = speed * 2 * math.pi * np.interp(at, np.arange(count), wander) * (1 + error)
    speeds = tuple(SpindleSpeed(round(k * 1e9 / RATE), float(s)) for k, s in zip(at, measured, strict=True))
    others = noisy_others(f"{kind} {number} {part}", {n: x for n, x in clean.items() if n != name}, levels,
                          turns)
    return Observed(CHANNELS[name], (clean[name] + noise).astype(np.float32), others, turns, speeds, join_truth(()),
                    (), float(noise.std()))


def _along(wave: Floats, turns: Floats) -> Floats:
    """A revolution (TABLE,) laid along the turns (n,)."""
    found: Floats = np.interp((turns % 1.0) * TABLE, np.arange(TABLE + 1), np.concatenate([wave, wave[:1]]))
    return found


def coloured_slow(rng: np.random.Generator, count: int, corner: float) -> Floats:
    """Slow noise of rms 1 below `corner` [Hz], made at 100 Hz and interpolated, within three times its rms."""
    few = math.ceil(count * 100 / RATE) + 2
    slow = ndimage.gaussian_filter1d(rng.standard_normal(few + 400), 100 / (2 * math.pi * corner))[200:-200]
    slow = np.clip(slow / slow.std(), -3, 3)
    found: Floats = np.interp(np.arange(count) * 100 / RATE, np.arange(len(slow)), slow)
    return found


def _revolution(motion: Motion, name: str, speed: float) -> Floats:
    """One revolution (TABLE,) of the settled motion: mean over the revolutions of the held part."""
    first, last = math.ceil(SETTLED * speed), int(HELD_UNTIL * speed)
    at = (np.arange(first * TABLE, last * TABLE) / TABLE) * RATE / speed
    values = ndimage.map_coordinates(motion.samples[:, SENSED.index(name)].astype(np.float64), at[None, :], order=3)
    found: Floats = values.reshape(last - first, TABLE).mean(axis=0)
    return found


def _passes(rng: np.random.Generator, count: int) -> Floats:
    """Envelope of several passes: entries and exits of 20 ms to 1 s, cuts of 3 to 20 s, air of 0.5 to 3 s."""
    time = np.arange(count) / RATE
    points, t = [(0.0, 0.0)], float(rng.uniform(1.0, 4.0))
    while t < count / RATE:
        rise, fall = (float(np.exp(rng.uniform(math.log(0.02), 0.0))) for _ in range(2))
        length, level = float(rng.uniform(3.0, 20.0)), float(rng.uniform(0.6, 1.0))
        points += [(t, 0.0), (t + rise, level), (t + rise + length, level), (t + rise + length + fall, 0.0)]
        t += rise + length + fall + float(rng.uniform(0.5, 3.0))
    found: Floats = np.interp(time, [p for p, _ in points], [v for _, v in points])
    return found
