"""Simulated motion of a cut, what it truly was, and what sensors would show of it.

The cut is simulated once without any noise; noise, machine tones, coolant and the tachometer's error are put on
afterwards. The truth is the attractor's: amplitudes of the judged channel without noise, at equal angles of the tool,
with no estimate of the speed (process/truth.py). It is that of the channel because a microphone hears accelerations:
a chatter that is a tenth of the displacement can be most of the sound.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from turnmill_core.detection.cuts import AIR_SECONDS, Cut, generator
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.chatter import SpindleSpeed
from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation import Tool
from turnmill_core.prediction import PredictedType
from turnmill_core.process.sensors import CHANNELS, SoundModel
from turnmill_core.process.simulation import SimulationConfig, simulate
from turnmill_core.process.truth import (
    CROSSING,
    MARKS_PER_TURN,
    PERIODS,
    Truth,
    crossings,
    join_truth,
    principal_turns,
    truth_of_marks,
)

Floats = NDArray[np.float64]

RATE = 12800
SENSED = ("sound", "tool_x", "tool_y")
OVERSAMPLING = 12
"""Steps of integration per sample: with fewer, the entries of teeth beat with the steps, which the resonance of a panel
makes audible."""
TACHOMETER_HZ = 250.0
TRUTH_HOP = 0.03
TOP = 5000.0
LASTING = (0.2, 1.0)
"""Lengths of the windows of the lasting truth [s]: a line that turns a hundredth of a revolution each revolution passes
for synchronous in a short one."""
SURE, NOT = 0.25, 0.12
"""Asynchronous (or half-order) over synchronous amplitude from which a window is chatter, and below which it is not;
the threshold of 0.2 lies between."""


RUNOUT_ONLY = 0.9
"""Spectral radius below which half-order lines are those of runout alone."""


@dataclass(frozen=True)
class Motion:
    """A simulated cut: samples (n, 3) of SENSED without noise, and its truth; duration [s]."""

    cut: Cut
    samples: NDArray[np.float32]
    truth: Truth

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.samples) / RATE


def simulate_cut(cut: Cut) -> Motion:
    """Motion of a cut; a ramp ends when its asynchronous amplitude has long passed the synchronous one's share."""
    quiet = SoundModel(background=0.0, tones=())
    config = SimulationConfig(sample_rate=RATE, channels=SENSED, displacement_noise=0.0, oversampling=OVERSAMPLING,
                              sound=replace(quiet, panels=quiet.panels[:2]))
    samples: list[NDArray[np.float32]] = []
    truths: list[Truth] = []
    above = 0.0
    for chunk in simulate(cut.operation, config, 0):
        samples.extend(b.samples for b in chunk.blocks)
        truths.append(chunk.truth)
        if cut.rate:
            above = _above(chunk.truth, above)
            if above > 1.2:
                break
    return Motion(cut, np.concatenate(samples), join_truth(truths))


def _above(truth: Truth, so_far: float) -> float:
    """Seconds, about, for which the ratio has been three times the crossing without a break."""
    for ratio in truth.ratio:
        so_far = so_far + 0.03 if ratio > 3 * CROSSING else 0.0
    return so_far


@dataclass(frozen=True)
class Observed:
    """What a monitor gets: the judged channel's samples (n,), the others' (n, 2) and spindle speeds; and what not.

    turns (n,): true revolutions of the tool at the samples; truth: of the channel without noise; lasting: the same over
    longer windows (see LASTING), in which lines close to a spindle harmonic show too; noise: rms of all noise, in the
    channel's unit.
    """

    channel: Channel
    samples: NDArray[np.float32]
    others: NDArray[np.float32]
    turns: Floats
    speeds: tuple[SpindleSpeed, ...]
    truth: Truth
    lasting: tuple[Truth, ...]
    noise: float

    def blocks(self, size: int = 256) -> list[SensorBlock]:
        """Blocks of `size` samples."""
        channels = (self.channel, *(CHANNELS[name] for name in SENSED if name != self.channel.name))
        table = np.column_stack([self.samples, self.others])
        return [SensorBlock(round(k * 1e9 / RATE), "simulated", 1, k, float(RATE), channels, table[k: k + size])
                for k in range(0, len(table), size)]

    def items(self) -> list[SensorBlock | SpindleSpeed]:
        """Blocks and spindle speeds in order of stamp."""
        return sorted([*self.blocks(), *self.speeds], key=lambda item: item.stamp_ns)


def observe(motion: Motion, extra_error: float = 0.0) -> Observed:
    """Sensor signal of a motion: a channel, noise and machine sounds drawn from the case's number.

    extra_error: relative error of the tachometer beyond the drawn one (at most 0.2 %).
    """
    cut = motion.cut
    rng = generator(cut.kind, cut.number, "sensor")
    name = str(rng.choice(SENSED, p=[0.5, 0.25, 0.25]))
    clean = motion.samples[:, SENSED.index(name)].astype(np.float64)
    op, count = cut.operation, len(clean)
    at = np.arange(0.0, motion.duration + 1 / TACHOMETER_HZ, 1 / TACHOMETER_HZ)
    states = [axis_state_at(op, t, round(t * 1e9)) for t in at]
    turns = np.interp(np.arange(count) / RATE, at, [s.position[5] / (2 * math.pi) for s in states])
    error = float(rng.choice([0.0, rng.uniform(-2e-3, 2e-3)])) + extra_error
    speeds = tuple(SpindleSpeed(s.stamp_ns, s.velocity[5] * (1 + error)) for s in states)
    level = float(clean[count // 2:].std())
    noise = ambient(rng, name, count, turns, level)
    truth = channel_truth(op.tool, motion.truth, clean, turns)
    rest = {n: motion.samples[:, k].astype(np.float64) for k, n in enumerate(SENSED) if n != name}
    levels = {n: float(values[count // 2:].std()) for n, values in rest.items()}
    others = noisy_others(f"{cut.kind} {cut.number}", rest, levels, turns)
    per_second = op.conditions.tool_speed / (2 * math.pi * principal_turns(op.tool))
    lasting = tuple(channel_truth(op.tool, motion.truth, clean, turns, max(PERIODS, round(seconds * per_second)))
                    for seconds in LASTING)
    return Observed(CHANNELS[name], (clean + noise).astype(np.float32), others, turns, speeds, truth, lasting,
                    float(noise.std()))


def noisy_others(what: str, clean: Mapping[str, Floats], levels: Mapping[str, float],
                 turns: Floats) -> NDArray[np.float32]:
    """Channels that are not judged (n, k), each with noise of its own.

    what: seeds the noise; clean: values (n,) by name; levels: rms of each in the cut; turns (n,): of the tool.
    """
    columns = []
    for name, values in clean.items():
        rng = np.random.default_rng(zlib.crc32(f"{what} {name}".encode()))
        columns.append((values + ambient(rng, name, len(values), turns, levels[name])).astype(np.float32))
    return np.column_stack(columns)


def channel_truth(tool: Tool, motion: Truth, clean: Floats, turns: Floats, periods: int = PERIODS) -> Truth:
    """Truth of a channel without noise, over windows of so many principal `periods`.

    clean (n,) at RATE, turns (n,): revolutions of the tool; contact is that of the motion. Up to the highest
    frequency that the monitor listens to.
    """
    marks = np.arange(math.ceil(turns[0] * MARKS_PER_TURN), int(turns[-1] * MARKS_PER_TURN)) / MARKS_PER_TURN
    index = np.interp(marks, turns, np.arange(len(turns)))
    heard = signal.sosfiltfilt(signal.butter(6, TOP, fs=RATE, output="sos"), clean)
    values = ndimage.map_coordinates(heard, index[None, :], order=3, mode="nearest")
    period = principal_turns(tool)
    hop = max(1, round(TRUTH_HOP * (turns[-1] - turns[0]) * RATE / len(turns) / period))
    rows = np.stack([index / RATE, values, np.zeros_like(values), np.zeros_like(values)], axis=1)
    found, _ = truth_of_marks(rows, tool.teeth, period, False, hop, periods)
    at = np.clip(np.searchsorted(motion.time, found.time), 0, len(motion.time) - 1)
    return replace(found, in_cut=motion.in_cut[at], touched=motion.touched[at])


def ambient(rng: np.random.Generator, name: str, count: int, turns: Floats, level: float) -> Floats:
    """Noise of a channel [its unit], (count,); turns (count,): revolutions of the tool.

    A probe: white noise of 20 to 300 nm, at most a fifth of the signal's `level` (rms). A
    microphone: coloured background, the spindle's own tones, up to three machine tones, and in a third of the cases
    coolant, which is switched on at some time; all of it up to a third of the level.
    """
    if name != "sound":
        rms = min(float(np.exp(rng.uniform(math.log(2e-8), math.log(3e-7)))), 0.2 * level)
        return rms * rng.standard_normal(count)
    rms = level * float(np.exp(rng.uniform(math.log(0.02), math.log(0.3))))
    time = np.arange(count) / RATE
    sound = rms * coloured(rng, count, 300.0)
    for order in (1.0, 2.0):
        sound += rms * float(rng.uniform(0, 0.5)) * np.sin(2 * math.pi * order * turns + rng.uniform(0, 6))
    for _ in range(int(rng.integers(0, 4))):
        tone = float(rng.uniform(80, 2500))
        sound += rms * float(rng.uniform(0.05, 0.6)) * np.sin(2 * math.pi * tone * time + rng.uniform(0, 6))
    if rng.random() < 1 / 3:
        begin = float(rng.uniform(0, AIR_SECONDS + count / RATE / 3))
        low = float(rng.uniform(300, 1500))
        hiss = signal.lfilter(*signal.butter(1, [low, 3 * low], "bandpass", fs=RATE), rng.standard_normal(count))
        sound += rms * hiss / hiss.std() * np.clip((time - begin) / 0.2, 0, 1)
    return sound


def coloured(rng: np.random.Generator, count: int, corner: float) -> Floats:
    """Noise of rms 1 that falls above `corner` [Hz]."""
    pole = math.exp(-2 * math.pi * corner / RATE)
    found: Floats = signal.lfilter([math.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(count))
    return found


def _lasts(lasting: Truth, seconds: float, at: float) -> bool:
    """True where the truth over windows of `seconds` [s] is not sure that there is no chatter at a time [s]."""
    near = np.flatnonzero((np.abs(lasting.time - at) <= seconds / 2) & np.isfinite(lasting.ratio))
    return bool(len(near) and lasting.ratio[near[np.argmin(np.abs(lasting.time[near] - at))]] > NOT)


@dataclass(frozen=True)
class Episode:
    """One true chatter of a cut: kind, begin (20 % crossing), full amplitude and tripled amplitude [s]."""

    kind: ChatterKind
    begin: float
    full: float
    tripled: float


def true_kind(cut: Cut, asynchronous: float, half: float) -> ChatterKind | None:
    """What a motion in the cut is, from its asynchronous and half-order amplitudes over the synchronous one.

    None: near the threshold.
    With an even number of teeth half-order lines are flip where linear theory, at the true parameters, is
    unstable, and runout, thus STABLE, where its multipliers are all below RUNOUT_ONLY; between, a tool that leaves the
    cut may flip although small motions die away.
    """
    if asynchronous > SURE:
        return ChatterKind.HOPF
    if asynchronous > NOT:
        return None
    if cut.operation.tool.teeth % 2:
        return ChatterKind.FLIP if half > SURE else ChatterKind.STABLE if half <= NOT else None
    if half <= NOT:
        return ChatterKind.STABLE
    if cut.margin.predicted_type in (PredictedType.HOPF, PredictedType.FLIP):
        return ChatterKind.FLIP if half > SURE else None
    return ChatterKind.STABLE if cut.margin.spectral_radius < RUNOUT_ONLY else None


def true_kinds(cut: Cut, seen: Observed, verdicts: Sequence[Verdict]) -> list[ChatterKind | None]:
    """What each window really was.

    None near thresholds, at entry and exit, where the truth does not reach, where noise drowns the cut, and where a
    longer window shows lines that turn too slowly for the shorter ones.
    """
    truth = seen.truth
    drowned = np.hypot(truth.synchronous, truth.asynchronous) < seen.noise
    found: list[ChatterKind | None] = []
    with np.errstate(invalid="ignore"):
        half = truth.half_order / np.where(truth.synchronous > 0, truth.synchronous, np.nan)
    for v in verdicts:
        begin, end = v.window_start_ns * 1e-9, v.window_end_ns * 1e-9
        at = (truth.time >= begin) & (truth.time <= end)
        if not at.any():
            found.append(None)
        elif not truth.touched[at].any():
            found.append(ChatterKind.AIR)
        elif not truth.in_cut[at].all() or drowned[at].any():
            found.append(None)
        else:
            kinds = {true_kind(cut, a, h) for a, h in zip(truth.ratio[at], half[at], strict=True)}
            kind = kinds.pop() if len(kinds) == 1 else None
            lasts = any(_lasts(x, t, (begin + end) / 2) for x, t in zip(seen.lasting, LASTING, strict=True))
            found.append(None if kind is ChatterKind.STABLE and lasts else kind)
    return found


def episode(cut: Cut, seen: Observed) -> Episode | None:
    """The chatter at the end of a cut: None where it ends without, or is not sure, or is drowned in noise.

    full: its amplitude (asynchronous, or for flip half-order) first reaches 90 % of its median over the last 0.6 s;
    begin: last rising crossing of 20 % before that; tripled: three times its value at `begin` (NaN: never).
    """
    truth = seen.truth
    last = truth.time > truth.time[-1] - 0.6
    if not truth.in_cut[last].all() or np.median(np.hypot(truth.synchronous, truth.asynchronous)[last]) < seen.noise:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        half = truth.half_order / truth.synchronous
    kind = true_kind(cut, float(np.median(truth.ratio[last])), float(np.median(half[last])))
    if kind not in (ChatterKind.HOPF, ChatterKind.FLIP):
        return None
    amplitude = truth.asynchronous if kind is ChatterKind.HOPF else truth.half_order
    grown = truth if kind is ChatterKind.HOPF else replace(truth, asynchronous=amplitude)
    entered = float(truth.time[np.argmax(truth.in_cut)])
    full = _first(truth.time, amplitude, 0.9 * float(np.median(amplitude[last])), entered)
    rising = [c.time for c in crossings(grown) if c.rising and c.time <= full]
    begin = rising[-1] if rising else entered
    at = float(np.interp(begin, truth.time, amplitude))
    return Episode(kind, begin, full, _first(truth.time, amplitude, 3 * at, begin))


def _first(time: Floats, amplitude: Floats, level: float, after: float) -> float:
    at = np.flatnonzero((time >= after) & (amplitude >= level))
    return float(time[at[0]]) if len(at) else math.nan

