"""From the features of a window to a state, and from states to verdicts that hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

from turnmill_core.monitoring.background import Background
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.features import Features
from turnmill_core.monitoring.gate import plain_comb
from turnmill_core.monitoring.growth import Surge
from turnmill_core.monitoring.half_order import half_order
from turnmill_core.monitoring.verdict import ChatterKind, Reason
from turnmill_core.prediction import Prior

TRANSIENT = math.log(2.0)
"""A change of the synchronous amplitude between the halves of a window, up or down, that shows entry or exit."""

WARNING = 0.5
"""A family that will pass the enter threshold in less than this [s] makes the cut marginal."""

BELIEVED = 0.25
"""Share, over the one at which chatter begins, from which the growth of a family over several windows is believed."""

EVIDENT = 0.1
"""Energy of a family over that of the noise from which it needs no other channel to confirm it."""

SEEN_TO_SURGE = 2
"""Windows in a row over which a line must surge where no other channel confirms it."""

ALARMS = (ChatterKind.HOPF, ChatterKind.FLIP)
CHATTER = (*ALARMS, ChatterKind.FLIP_OR_RUNOUT)


@dataclass(frozen=True)
class Judgement:
    """State of one window by itself, and what it rests on.

    asynchronous_ratio, half_order_ratio [1], NaN where not computed; surges: it rests on a line that grows at the
    end of the window; faint: another channel must confirm it.
    """

    kind: ChatterKind
    reason: Reason
    text: str
    asynchronous_ratio: float = math.nan
    half_order_ratio: float = math.nan
    surges: bool = False
    faint: bool = False


def judge(config: ChatterConfig, f: Features, background: Background, cut: bool, held: ChatterKind,
          prior: Prior | None, warning: float = math.inf, risen: float = 1.0,
          surge: Surge | None = None, unsteady: bool = False) -> Judgement:
    """State of a window from its features.

    held: state so far; the leave thresholds apply to it, the enter thresholds to others; warning [s]: time in which a
    growing family will pass the enter threshold; risen: its energy at the end of the window over its mean there;
    surge: line that will pass it before the next window ends; unsteady: out of the cut before, and the signal at least
    doubles within the window; or it has fallen since the last.
    """
    asynchronous = sum(x.energy for x in f.lines)
    total = asynchronous + f.synchronous + f.own_half
    ratio = asynchronous / total if total > 0 else 0.0
    before = 2 * sum(background.line_energy(x) for x in f.half.members)
    half = min(1.0, max(0.0, f.half.energy - before) / f.synchronous) if f.synchronous > 0 else 0.0
    if not cut:
        return Judgement(ChatterKind.AIR, Reason.BELOW_NOISE, "no tooth passing comb stands out of the noise",
                         ratio, half)
    kind, reason, text, faint = _cut(config, f, ratio, half, held, prior, risen)
    surges = kind in (ChatterKind.STABLE, ChatterKind.MARGINAL) and surge is not None
    if surge is not None and surges:
        kind, reason, faint = ChatterKind.HOPF, Reason.ASYNCHRONOUS, surge.windows < SEEN_TO_SURGE
        text = (f"a line at {surge.frequency:.1f} Hz surges: {100 * surge.share:.1f} % of the energy at the end of the "
                f"window, {surge.growth:.1f} times as much as one window before")
    if kind is ChatterKind.STABLE and warning < WARNING and f.chatter is not None:
        kind, reason = ChatterKind.MARGINAL, Reason.ASYNCHRONOUS
        text = f"lines at {f.chatter.frequency:.1f} Hz grow exponentially: chatter in {warning:.1f} s if they go on"
    begins = held not in CHATTER or (held not in ALARMS and kind is ChatterKind.HOPF)
    changing = plain_comb(f) and abs(math.log(f.change)) > TRANSIENT
    if kind is not ChatterKind.STABLE and begins and (changing or unsteady):
        kind, reason = ChatterKind.STABLE, Reason.TRANSIENT
        what = f"the tooth passing harmonics change {f.change:.2g}-fold" if changing else "the signal grows or falls"
        text = f"entry or exit: {what}; else {text}"
    hopf = kind is ChatterKind.HOPF
    return Judgement(kind, reason, text, ratio, half, surges and hopf, faint and hopf)


def _cut(config: ChatterConfig, f: Features, ratio: float, half: float, held: ChatterKind, prior: Prior | None,
         risen: float) -> tuple[ChatterKind, Reason, str, bool]:
    """State of a window in the cut, reason, text, and whether another channel must confirm it."""
    threshold = config.leave_ratio if held in ALARMS else config.enter_ratio
    c = f.chatter
    if c is not None:
        share = c.energy / (c.energy + f.synchronous + f.own_half)
        spans, evident = c.explained > 0.5, c.energy > EVIDENT * f.noise
        if spans and share > threshold and (evident or held not in ALARMS):
            text = (f"lines at {c.frequency:.1f} Hz + i {f.frequency * config.principal_teeth:.1f} Hz hold "
                    f"{100 * share:.0f} % of the energy" + ("" if evident else ", faint in the noise"))
            return ChatterKind.HOPF, Reason.ASYNCHRONOUS, text, not evident
        now = risen * c.energy / (risen * c.energy + f.synchronous + f.own_half)
        if spans and evident and config.enter_ratio * BELIEVED < share < threshold < now:
            return (ChatterKind.HOPF, Reason.ASYNCHRONOUS,
                    f"lines at {c.frequency:.1f} Hz grow exponentially to {100 * now:.0f} % of the energy", False)
        if spans and evident and share > config.leave_ratio:
            return (ChatterKind.MARGINAL, Reason.ASYNCHRONOUS,
                    f"lines at {c.frequency:.1f} Hz hold {100 * share:.1f} % of the energy", False)
    if half > (config.leave_ratio if held in CHATTER else config.enter_ratio) and _dominates(config, f):
        return *half_order(config, half, prior), False
    return ChatterKind.STABLE, Reason.SYNCHRONOUS, f"{100 * (1 - ratio):.1f} % of the energy is synchronous", False


def _dominates(config: ChatterConfig, f: Features) -> bool:
    """True where half-order lines are more than the runout lines between tooth passing harmonics.

    Eccentricity gives lines at every multiple of the spindle frequency, flip chatter only at odd
    multiples of half the tooth passing frequency.
    """
    if config.odd:
        return f.half.energy > sum(x.energy for x in f.lines)
    return f.half.energy > f.synchronous - f.tooth - f.half.energy


@dataclass(frozen=True)
class Held:
    """State that the monitor holds, the one that would replace it, and for how many windows it has been seen."""

    kind: ChatterKind = ChatterKind.UNKNOWN
    rival: ChatterKind = ChatterKind.UNKNOWN
    count: int = 0


def persist(config: ChatterConfig, held: Held, kind: ChatterKind, enter: int) -> Held:
    """Held state after a window judged `kind`: a change needs its dwell of windows in a row that agree.

    enter: windows that chatter needs (see :func:`windows_to_enter`).
    """
    if kind == held.kind:
        return Held(kind, kind, 0)
    if kind is ChatterKind.UNKNOWN:
        return Held()
    count = held.count + 1 if kind == held.rival or (kind in CHATTER and held.rival in CHATTER) else 1
    if count >= _dwell(config, held.kind, kind, enter):
        return Held(kind, kind, 0)
    return Held(held.kind, kind, count)


LOUD = 1.5
"""Level over what the gate asks for, from which chatter alone shows a cut in half the time."""


ENTRY = 1
"""Further windows that chatter must last while windows reach back into the air."""


def windows_to_enter(config: ChatterConfig, f: Features, background: Background, held: Held, sure: bool,
                     fresh: bool = False) -> int:
    """Windows in a row that chatter must last before it begins.

    One in a cut where a steady growth over several windows has led to it, or other channels hear it too while the
    signal does not fall (sure), else enter_dwell; ENTRY more in windows that began before the cut (fresh), where the
    averages still hold air. Longer where
    nothing else shows a cut, neither a plain comb now nor a cut before: machine sounds out of the cut can look like
    a family for some tenths of a second; half as long where it is far louder than the air before.
    """
    if plain_comb(f) or held.kind not in (ChatterKind.AIR, ChatterKind.UNKNOWN):
        return config.enter_dwell + ENTRY if fresh else 1 if sure else config.enter_dwell
    floor = background.energy if config.noise_floor is None else config.noise_floor**2
    loud = math.isfinite(floor) and f.energy > (LOUD * config.gate_ratio) ** 2 * floor
    return max(config.enter_dwell, config.lone_dwell // 2 if loud else config.lone_dwell)


def _dwell(config: ChatterConfig, old: ChatterKind, new: ChatterKind, enter: int) -> int:
    if new in CHATTER:
        return enter
    if old in CHATTER:
        return config.leave_dwell
    if ChatterKind.AIR in (old, new) and old is not ChatterKind.UNKNOWN:
        return config.cut_dwell
    return config.marginal_dwell if new is ChatterKind.MARGINAL else 1
