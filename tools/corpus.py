"""Labelled signals of random cuts: a tool, its modes, a speed, an immersion and a depth that is ramped over the limit.

Every case is made from its number alone, with the process simulator; the truth is that of the judged channel without
noise (what the cut really did, not what linear theory says). Cases with a number below 10 000 serve to calibrate,
the others to test.

    python -m tools.corpus FIRST COUNT        one line per case: what it is and what the truth says
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_core.monitoring.chatter import ChatterConfig, SpindleSpeed, config_from_operation, finish, initial, update
from turnmill_core.monitoring.separation import lay_out, prepare, synchronous
from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation import Operation, SchedulePoint
from turnmill_core.operation_file import parse_operation
from turnmill_core.process.sensors import SoundModel, Tone
from turnmill_core.process.simulation import SimulationConfig, simulate
from turnmill_core.process.truth import join_truth

SECONDS = 4.0


@dataclass(frozen=True)
class Case:
    """One signal: the operation with its schedule, how it is measured, and the tachometer's relative error."""

    number: int
    what: str
    operation: Operation
    config: SimulationConfig
    speed_error: float


def make(number: int) -> Case:
    """Case `number`: air, then a cut of moderate depth that stays (two in five) or becomes up to eight times deeper."""
    rng = np.random.default_rng(number)
    teeth = int(rng.choice([1, 2, 3, 4, 5, 6], p=[0.04, 0.26, 0.22, 0.24, 0.1, 0.14]))
    diameter = float(rng.uniform(8, 25))
    natural = float(np.exp(rng.uniform(math.log(350), math.log(2200))))
    flips = bool(rng.random() < 0.2)
    tooth = natural / float(rng.uniform(0.44, 0.56) if flips else np.exp(rng.uniform(math.log(0.7), math.log(9))))
    tooth = float(np.clip(tooth, teeth * 1200 / 60, teeth * 18000 / 60))
    rpm = 60 * tooth / teeth
    sense = str(rng.choice(["up", "down"] if flips else ["up", "down", "up", "down", "slot"]))
    largest = 0.0 if not flips else math.log(0.1)
    immersion = diameter if sense == "slot" else diameter * float(np.exp(rng.uniform(math.log(0.04), largest)))
    ktc = float(rng.uniform(600, 2000))
    lines = [f"name: case {number}", "schema: 1", "process: milling", "machine: simulated", "sources: random", "tool:",
             "  name: end mill", f"  diameter: {diameter:.3f} mm", f"  teeth: {teeth}",
             f"  helix_angle: {float(rng.choice([0, 20, 30])):g} deg"]
    runout = float(rng.choice([0.0, 1.0, 8.0], p=[0.4, 0.3, 0.3]))
    if runout:
        phase = rng.uniform(0, 2 * math.pi)
        offsets = [runout * math.cos(phase + 2 * math.pi * j / teeth) + 0.3 * runout * rng.standard_normal()
                   for j in range(teeth)]
        lines.append("  runout: [" + ", ".join(f"{o:.4f} um" for o in offsets) + "]")
    lines += ["  structure:", "    frame: tool", "    modes:"]
    damping, lowest = float(rng.uniform(0.008, 0.04)), float(np.exp(rng.uniform(math.log(4e-4), math.log(4e-3))))
    arc = 2 * math.pi if sense == "slot" else 2 * math.acos(1 - 2 * immersion / diameter)
    stiffness = lowest * ktc * 1e6 * max(0.2, teeth * arc / (4 * math.pi)) / (2 * damping * (1 + damping))
    for direction in ("x", "y"):
        f = natural * float(rng.uniform(0.85, 1.15))
        lines.append(f"      - {{direction: {direction}, frequency: {f:.3f} Hz, damping: {100 * damping:.3f} %, "
                     f"mass: {stiffness / (2 * math.pi * f) ** 2:.6f} kg}}")
    lines += ["workpiece:", "  name: block", "  length: 9000 mm", "  width: 200 mm", "  height: 100 mm", "material:",
              "  name: metal", f"  Ktc: {ktc:.1f} MPa", f"  Krc: {ktc * rng.uniform(0.2, 0.5):.1f} MPa",
              f"  Kac: {ktc * 0.15:.1f} MPa", "cut:", f"  tool_speed: {rpm:.3f} rpm", "  depth: 1 mm",
              f"  feed_per_tooth: {rng.uniform(0.05, 0.15):.4f} mm", f"  sense: {sense}"]
    if sense != "slot":
        lines.append(f"  radial_immersion: {immersion:.4f} mm")
    op = parse_operation("\n".join(lines) + "\n", f"case {number}")
    return _scheduled(number, rng, op, lowest)


def _scheduled(number: int, rng: np.random.Generator, op: Operation, lowest: float) -> Case:
    """Case with a schedule; lowest [m]: about the depth that is stable at every speed (2 k zeta over the mean cut)."""
    speed = op.conditions.tool_speed
    stays = bool(rng.random() < 0.4)
    first = lowest * float(rng.uniform(0.3, 0.9))
    last = first * float(rng.uniform(0.8, 1.2)) if stays else lowest * float(np.exp(rng.uniform(0, math.log(8))))
    begin = float(rng.uniform(1.5, 2.0))
    length = float(rng.choice([0.02, 0.5, 1.0]))
    ramp = float(rng.choice([0.0, 0.0, 0.03, -0.05])) * speed
    points = [(0.0, speed, -1e-4), (0.6, speed, -1e-4), (0.9, speed, first), (begin, speed, first),
              (begin + length, speed + ramp, last), (SECONDS, speed + ramp, last)]
    op = replace(op, schedule=tuple(SchedulePoint(t, s, 0.0, a) for t, s, a in points))
    tones = [Tone(float(rng.uniform(0.001, 0.01)), order=1.0)]
    for _ in range(rng.integers(0, 4)):
        tones.append(Tone(float(rng.uniform(0.001, 0.02)), frequency=float(rng.uniform(80, 2500))))
    sound = SoundModel(background=float(np.exp(rng.uniform(math.log(0.003), math.log(0.06)))), tones=tuple(tones))
    channel = str(rng.choice(["sound", "tool_x", "tool_y"], p=[0.5, 0.25, 0.25]))
    config = SimulationConfig(channels=(channel,), sound=sound, displacement_noise=float(np.exp(rng.uniform(
        math.log(2e-8), math.log(1e-6)))))
    error = float(rng.choice([0.0, rng.uniform(-2e-3, 2e-3)]))
    what = f"{op.tool.teeth} teeth, {speed * 30 / math.pi:.0f} rpm, {channel}, " + ("held" if stays else "deeper")
    return Case(number, what, op, config, error)


@dataclass(frozen=True)
class Heard:
    """Verdicts on a case and what each window really held.

    touched: True where the tool cuts at some time in the window; ratios (n, 2): asynchronous and half-order energy over
    all energy of the judged channel without noise and tones, separated at the true speed; noise (n,): energy of
    noise and tones over all energy; samples: what the monitor heard.
    """

    case: Case
    verdicts: tuple[Verdict, ...]
    touched: np.ndarray
    ratios: np.ndarray
    noise: np.ndarray
    samples: np.ndarray


def run(case: Case, **settings: object) -> Heard:
    """Simulate and judge a case; axis states at 250 Hz carry the tachometer's error."""
    config: ChatterConfig = replace(config_from_operation(case.operation), **settings)  # type: ignore[arg-type]
    state, verdicts, truths = initial(config), [], []
    blocks: list[SensorBlock] = []
    for chunk in simulate(case.operation, case.config, case.number):
        truths.append(chunk.truth)
        blocks.extend(chunk.blocks)
    sound = replace(case.config.sound, background=0.0, tones=())
    silent = replace(case.config, truth=False, displacement_noise=0.0, sound=sound)
    clean = np.concatenate([b.samples[:, 0] for c in simulate(case.operation, silent, case.number) for b in c.blocks])
    speeds = []
    for k in range(int(SECONDS * 250) + 1):
        axes = axis_state_at(case.operation, k / 250, round(k * 4e6))
        speeds.append(SpindleSpeed(axes.stamp_ns, axes.velocity[5] * (1 + case.speed_error)))
    for item in sorted([*blocks, *speeds], key=lambda i: i.stamp_ns):
        state, found = update(config, state, item)
        verdicts.extend(found)
    verdicts.extend(finish(config, state)[1])
    noisy = np.concatenate([b.samples[:, 0] for b in blocks])
    truth, rate = join_truth(truths), case.config.sample_rate
    touched, ratios, noise = [], [], []
    for v in verdicts:
        start, end = round(v.window_start_ns * 1e-9 * rate), v.last_sample + 1
        at = (truth.time >= start / rate) & (truth.time <= end / rate)
        touched.append(bool(truth.touched[at].any()))
        moves = any(start < t * rate < end for t in _steps(case))
        ratios.append((math.nan, math.nan) if moves else _ratios(case, clean[start:end], start))
        total = _energy(noisy[start:end], rate)
        noise.append(_energy(noisy[start:end] - clean[start:end], rate) / total if total > 0 else 1.0)
    return Heard(case, tuple(verdicts), np.array(touched), np.array(ratios), np.array(noise), noisy)


def _steps(case: Case) -> list[float]:
    """Times [s] of entry and of sudden changes of the depth."""
    points = case.operation.schedule
    fast = [p.time for p, q in pairwise(points) if q.time - p.time < 0.1]
    return [*np.arange(0.6, 0.96, 0.03), *fast]


def _energy(x: np.ndarray, rate: float) -> float:
    """Mean square above 40 Hz."""
    power = np.abs(np.fft.rfft(x)) ** 2
    return float(2 * power[np.fft.rfftfreq(len(x), 1 / rate) > 40].sum() / len(x) ** 2) if len(x) else 0.0


def _ratios(case: Case, x: np.ndarray, start: int) -> tuple[float, float]:
    """Asynchronous and half-order energy over all energy of a noise-free window, at the true angle of the tool."""
    rate, teeth = case.config.sample_rate, case.operation.tool.teeth
    turns = np.array([axis_state_at(case.operation, (start + k) / rate, 0).position[5] for k in range(0, len(x), 64)])
    p = prepare(x, float(rate), 5000.0)
    turns = np.interp(np.arange(len(p.samples)) / p.rate, np.arange(0, len(x), 64) / rate, turns / (2 * math.pi))
    try:
        layout = lay_out(p, turns, 2)
    except ValueError:
        return math.nan, math.nan
    both = synchronous(layout, layout.values, 2)
    order = np.arange(len(both.mean))
    energy = np.where(order * layout.frequency / 2 > 40, both.energy(), 0.0)
    left = _energy(layout.values - both.wave, layout.points * layout.frequency)
    half = float(energy[(order % (2 * teeth)) == teeth].sum())
    odd_rest = float(energy[(order % 2 == 1) & ((order % (2 * teeth)) != teeth)].sum())
    power = np.maximum(np.abs(both.mean) ** 2, 1e-300)
    turning = np.abs(np.imag(np.conj(both.mean) * both.trend)) / (2 * math.pi * power) > 0.006
    turned = energy * (turning & (order % (2 * teeth) != 0))
    left, half = left + float(turned.sum()), half - float(turned[(order % (2 * teeth)) == teeth].sum())
    odd_rest -= float(turned[(order % 2 == 1) & ((order % (2 * teeth)) != teeth)].sum())
    total = left + float((energy - turned).sum())
    return ((left + odd_rest) / total, half / total) if total > 0 else (math.nan, math.nan)


def right(state: ChatterKind, heard: Heard) -> np.ndarray:
    """Whether `state` would be right for each window: 1, 0, or NaN where that cannot be said (see true_kinds)."""
    kinds = true_kinds(heard)
    if state is ChatterKind.MARGINAL:
        near = [k is not ChatterKind.AIR and 0.012 < max(r) < 0.07 for k, r in zip(kinds, heard.ratios, strict=True)]
        return np.array([1.0 if n else math.nan if k is None else 0.0 for n, k in zip(near, kinds, strict=True)])
    return np.array([math.nan if k is None else float(k is state) for k in kinds])


def true_kinds(heard: Heard) -> list[ChatterKind | None]:
    """What each window really was; None: neither clearly one thing nor the other, or drowned in noise.

    AIR where nothing is touched. HOPF where the asynchronous energy is above 0.06 of all, FLIP (odd teeth) or
    FLIP_OR_RUNOUT (even) where the half-order energy is, STABLE where both are below 0.025 (the monitor's thresholds
    are 0.04 and 0.02). None where noise and tones hold more than half of the energy of a cut, or the window holds an
    entry or an exit.
    """
    odd = heard.case.operation.tool.teeth % 2 == 1
    found: list[ChatterKind | None] = []
    for touched, (asynchronous, half), noise in zip(heard.touched, heard.ratios, heard.noise, strict=True):
        if not touched:
            found.append(ChatterKind.AIR)
        elif not math.isfinite(asynchronous) or noise > 0.5:
            found.append(None)
        elif asynchronous > 0.06:
            found.append(ChatterKind.HOPF)
        elif half > 0.06:
            found.append(ChatterKind.FLIP if odd else ChatterKind.FLIP_OR_RUNOUT)
        else:
            found.append(ChatterKind.STABLE if max(asynchronous, half) < 0.025 else None)
    return found


def main() -> None:
    """Print cases."""
    first, count = (int(a) for a in sys.argv[1:3])
    for number in range(first, first + count):
        heard = run(make(number))
        kinds = true_kinds(heard)
        right = [v.state == k for v, k in zip(heard.verdicts, kinds, strict=True) if k is not None]
        wrong = Counter((k.name, v.state.name) for v, k in zip(heard.verdicts, kinds, strict=True)
                        if k is not None and v.state != k and v.state is not ChatterKind.UNKNOWN)
        print(number, heard.case.what, f"{np.mean(right):.2f} right", dict(wrong), flush=True)


if __name__ == "__main__":
    main()
