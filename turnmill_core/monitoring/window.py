"""Judgement of one window: length, channel, speed, features, state."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from turnmill_core.monitoring import stream as streams
from turnmill_core.monitoring.agreement import Agreement, ask, asked, with_others
from turnmill_core.monitoring.background import Background
from turnmill_core.monitoring.belief import Belief, after, refinement, search
from turnmill_core.monitoring.channel import choose, others
from turnmill_core.monitoring.confidence import confidence, evidence
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.decision import ALARMS, CHATTER, Held, Judgement, judge, persist, windows_to_enter
from turnmill_core.monitoring.features import Features, features
from turnmill_core.monitoring.gate import in_cut, learn, plain_comb
from turnmill_core.monitoring.growth import Seen, Surge, remember, rise, surges, surging, time_to
from turnmill_core.monitoring.separation import prepare, resampled_turns
from turnmill_core.monitoring.spectrum import Array, spectrum
from turnmill_core.monitoring.speed import (
    STEADY,
    Rotation,
    SpindleSpeed,
    constant_rotation,
    held_until,
    rotation,
    speed_at,
)
from turnmill_core.monitoring.stream import Stream
from turnmill_core.monitoring.tip import ShankRunout, learned, probes_in, tip_in
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.prediction import Prior

LARGEST_SPREAD = 0.1
"""Relative change of the spindle speed from its mean inside a window that is still followed."""

FEWEST_REVOLUTIONS = 6
LOOK_EVERY = 4
"""While chatter is held, a wrong tachometer is looked for in every fourth window (they overlap by three quarters)."""

YOUNG_NS = 500_000_000
"""Time after the beginning of a cut for which its harmonics are wide [ns]: with the depth, a helical tool's phases
change."""

FALLING = 0.7
"""Energy over that of the window before, below which the tool leaves the cut: chatter that begins adds to it."""

OUTSIDE = (ChatterKind.AIR, ChatterKind.UNKNOWN)
LONG_AGO_NS = -(2**62)

STILL = 0.25
"""Energy over that of the strongest line of a family from which the member that named it before goes on to do so."""

APART = 1.3
"""Bins by which a line must then be away from a tooth passing harmonic."""


@dataclass(frozen=True)
class Tracker:
    """What is carried from window to window of one device.

    Held state; channel that is judged and its background; set_aside: backgrounds of channels that were judged before,
    by name; belief of the speed; history: strongest families of the last windows; runout: of the shank, as fibre probes
    see it; entered_ns: end of the window with which the cut began; energy: of the newest window;
    rising: lines at its end; named: frequency of the chatter that is held [Hz] (NaN: none).
    """

    held: Held = field(default_factory=Held)
    channel: str = ""
    background: Background = field(default_factory=Background)
    set_aside: tuple[tuple[str, Background], ...] = ()
    belief: Belief = field(default_factory=Belief)
    history: tuple[Seen, ...] = ()
    runout: ShankRunout = field(default_factory=ShankRunout)
    entered_ns: int = LONG_AGO_NS
    energy: float = 0.0
    rising: tuple[Surge, ...] = ()
    named: float = math.nan

    def on(self, channel: str) -> Tracker:
        """Tracker that judges a channel: with its own background, and nothing else that depends on its scale."""
        if channel == self.channel:
            return self
        known = {**dict(self.set_aside), self.channel: self.background}
        background = known.pop(channel, Background())
        return replace(self, channel=channel, background=background, set_aside=tuple(known.items()), history=(),
                       energy=0.0, rising=())


def judge_window(config: ChatterConfig, tracker: Tracker, s: Stream, end: int, speeds: tuple[SpindleSpeed, ...],
                 prior: Prior | None) -> tuple[Tracker, Verdict]:
    """Verdict on the window that ends before sample `end`, and the tracker after it."""
    gap_ns = round(config.speed_timeout * 1e9)
    speeds = held_until(speeds, s.stamp(end - 1), round(config.hop * 1e9))
    end_speed = speed_at(speeds, s.stamp(end - 1), gap_ns)
    source = SpeedSource.AXIS
    if not math.isfinite(end_speed):
        end_speed, source = config.nominal_speed, SpeedSource.NOMINAL
    seconds = config.window
    if end_speed > 0:
        seconds = min(config.longest_window, max(seconds, config.revolutions * 2 * math.pi / end_speed))
    start = end - max(2, round(seconds * s.sample_rate))
    blank = Verdict(s.stamp(max(start, s.origin)), s.stamp(end - 1), end - 1, s.device, s.stream_id, "",
                    ChatterKind.UNKNOWN, Reason.NONE, "", spindle_speed=end_speed if end_speed > 0 else math.nan,
                    spindle_speed_source=source, prior=prior)

    reason, text = streams.trouble(s, start, end)
    if reason is not Reason.NONE:
        return _unknown(tracker, blank, reason, text)
    seen = probes_in(config, s, start, end, speeds, gap_ns)
    if seen is None:
        channel, x, reason, text = choose(config, s, start, end)
        name = s.channels[channel].name
    else:
        name, reason, text = config.channel, seen.reason, seen.text
        x = tip_in(config, seen, tracker.runout, s.sample_rate)
    blank = replace(blank, channel=name)
    if reason is not Reason.NONE:
        return _unknown(tracker, blank, reason, text)
    level = math.sqrt(max(0.0, float(np.einsum("i,i", x, x)) / len(x) - float(x.mean()) ** 2))
    blank = replace(blank, level=level)
    if end_speed <= 0 or seconds * end_speed < FEWEST_REVOLUTIONS * 2 * math.pi:
        return _unknown(tracker, blank, Reason.NO_SPEED, "the spindle stands still, is too slow for a window, or its "
                        "speed is unknown")
    turned = rotation(speeds, s.stamp(start), s.stamp(end - 1), len(x), s.sample_rate, gap_ns)
    if turned is None:
        turned, source = constant_rotation(config.nominal_speed, len(x), s.sample_rate), SpeedSource.NOMINAL
    if config.nominal_speed <= 0 and source is SpeedSource.NOMINAL:
        return _unknown(tracker, blank, Reason.NO_SPEED,
                        "no axis state covers the window and no nominal speed is known")
    if turned.spread > LARGEST_SPREAD:
        return _unknown(tracker, blank, Reason.SPEED_CHANGING,
                        f"the spindle speed differs by up to {100 * turned.spread:.0f} % from its mean")
    tracker, verdict = _judge_samples(config, tracker.on(name), replace(blank, spindle_speed_source=source), x,
                                      s.sample_rate, turned, prior, others(s, start, end, name))
    if seen is not None and verdict.state is ChatterKind.AIR and verdict.reason is not Reason.PERSISTENCE:
        runout = learned(tracker.runout, seen)
        new = runout.known and not tracker.runout.known
        tracker = replace(tracker, runout=runout, background=Background() if new else tracker.background)
    return tracker, verdict


def _unknown(tracker: Tracker, blank: Verdict, reason: Reason, text: str) -> tuple[Tracker, Verdict]:
    tracker = replace(tracker, held=Held(), history=(), rising=(), named=math.nan)
    return tracker, replace(blank, reason=reason, reason_text=text)


def _judge_samples(config: ChatterConfig, tracker: Tracker, blank: Verdict, x: Array, rate: float, turned: Rotation,
                   prior: Prior | None, others: Iterable[tuple[str, Array]]) -> tuple[Tracker, Verdict]:
    p = prepare(x, rate, config.band[1])
    steady = turned.spread < STEADY
    turns = constant_rotation(turned.mean, len(p.samples), p.rate).turns if steady else resampled_turns(
        turned.turns, len(p.samples), p.rate / rate)
    grid_index = (blank.last_sample + 1) // max(1, round(config.hop * rate))
    measured, belief = blank.spindle_speed_source is not SpeedSource.NOMINAL, tracker.belief
    if not measured or (not belief.sure and (tracker.held.kind not in CHATTER or grid_index % LOOK_EVERY == 0)):
        belief = search(config, belief, p, turns, measured, tracker.background)
    ratio, band = refinement(config, belief)
    outside = tracker.held.kind in OUTSIDE
    young = outside or blank.window_end_ns < tracker.entered_ns + YOUNG_NS
    alarmed = tracker.held.kind in ALARMS
    f = features(p, turns, steady, config.principal_teeth, config.band[0], ratio, band, tracker.background,
                 APART if young else 0.0, surges=not alarmed and not outside)
    cut = in_cut(config, f, tracker.background, tracker.held.kind in CHATTER)
    history, warning = _growth(config, tracker.history, f, blank.window_end_ns)
    risen = rise(history, f.seconds) if f.chatter is not None and f.chatter.sidebands else 1.0
    rising = surges(f, tracker.rising, config.hop)
    surge = surging(rising, config.enter_ratio)
    unsteady = (outside and _doubles(p.samples)) or f.energy < FALLING * tracker.energy
    judgement = judge(config, f, tracker.background, cut, tracker.held.kind, prior, warning, risen, surge, unsteady)
    heard = Agreement()
    if not alarmed and asked(config, judgement):
        small = surge if judgement.surges else None
        heard = ask(f, judgement.kind, small, others, rate, turned, config.principal_teeth, config.band)
        judgement = with_others(judgement, heard)
    fresh = judgement.kind is ChatterKind.HOPF and (outside or blank.window_start_ns < tracker.entered_ns)
    sure = risen > 1 or judgement.surges or (bool(heard.confirm) and f.energy >= tracker.energy)
    enter = windows_to_enter(config, f, tracker.background, tracker.held, sure, fresh)
    held = persist(config, tracker.held, judgement.kind, enter)
    entered = blank.window_end_ns if outside and held.kind not in OUTSIDE else tracker.entered_ns
    background = tracker.background
    if judgement.kind is ChatterKind.AIR and held.kind is ChatterKind.AIR:
        background = learn(config, background, f, spectrum(p.samples, p.rate, p.top))
    name = _name(f, judgement, surge, tracker.named) if held.kind is ChatterKind.HOPF else math.nan
    verdict = _verdict(config, blank, f, judgement, held, name)
    found = evidence(f, judgement.asynchronous_ratio, judgement.half_order_ratio, config.enter_ratio,
                     held.kind != judgement.kind, tracker.background.energy)
    verdict = replace(verdict, confidence=confidence(held.kind, found))
    if math.isnan(name) and held.kind is ChatterKind.HOPF:
        name = tracker.named
    return replace(tracker, held=held, background=background, belief=after(belief, f), history=history,
                   entered_ns=entered, energy=f.energy, rising=rising, named=name), verdict


def _doubles(x: Array) -> bool:
    """True where the amplitude of the second half is more than twice that of the first."""
    early, late = np.array_split(x, 2)
    return bool(late.var() > 4 * early.var())


def _growth(config: ChatterConfig, history: tuple[Seen, ...], f: Features,
            end_ns: int) -> tuple[tuple[Seen, ...], float]:
    """Families of the last windows, and the time [s] in which a steadily growing one passes the enter threshold."""
    c = f.chatter
    if c is None or not (c.sidebands or plain_comb(f)) or c.explained < 0.5:
        return (), math.inf
    share = c.energy / (c.energy + f.synchronous + f.own_half)
    history = remember(history, Seen(end_ns * 1e-9, c.frequency, share), 1 / f.seconds,
                       f.frequency * config.principal_teeth)
    return history, time_to(history, config.enter_ratio)


def _name(f: Features, judgement: Judgement, surge: Surge | None, before: float) -> float:
    """Frequency [Hz] of the line that names Hopf chatter in a window; NaN where it shows none of it.

    The strongest one, or the one that surges; but the line that named it before [Hz] while it is still strong, so
    that the name does not jump between sidebands. Only that line in a window that shows no Hopf chatter by itself.
    """
    if judgement.surges and surge is not None:
        return surge.frequency
    hopf, c = judgement.kind is ChatterKind.HOPF, f.chatter
    family = f.lines if c is None or not hopf else tuple(x for x in f.lines if x.frequency in c.members)
    same = max((x for x in family if abs(x.frequency - before) < 2 / f.seconds), key=lambda x: x.energy, default=None)
    if not hopf or c is None:
        return math.nan if same is None else same.frequency
    strongest = max((x.energy for x in family if x.frequency == c.frequency), default=0.0)
    return same.frequency if same is not None and same.energy > STILL * strongest else c.frequency


def _verdict(config: ChatterConfig, blank: Verdict, f: Features, judgement: Judgement, held: Held,
             name: float) -> Verdict:
    """name [Hz]: of Hopf chatter, if that is held."""
    reason, text = judgement.reason, judgement.text
    if held.kind != judgement.kind:
        reason, text = Reason.PERSISTENCE, f"held; this window by itself: {judgement.kind.name.lower()}, {text}"
    frequency, members = name, tuple[float, ...]()
    if f.chatter is not None and name in f.chatter.members:
        members = f.chatter.members
    elif held.kind in (ChatterKind.FLIP, ChatterKind.FLIP_OR_RUNOUT):
        frequency, members = f.half.frequency, f.half.members
    return replace(
        blank, state=held.kind, reason=reason, reason_text=text, chatter_frequency=frequency, chatter_family=members,
        tooth_passing_frequency=config.teeth * f.frequency, spindle_speed=2 * math.pi * f.frequency,
        spindle_speed_source=SpeedSource.REFINED if f.comb >= 2 else blank.spindle_speed_source,
        asynchronous_ratio=judgement.asynchronous_ratio, half_order_ratio=judgement.half_order_ratio,
        spindle_speed_confidence=f.comb / f.comb_of if f.comb_of else 0.0,
    )
