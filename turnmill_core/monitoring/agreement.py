"""Do the other channels of a device hear the chatter that the judged one hears?

Chatter shakes tool, workpiece and air alike, at the same frequencies; a sound from next door, or a loose cable, shows
in one channel alone. The other channels are asked only in windows in which chatter would begin.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from turnmill_core.monitoring._kernels.family import distance
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.decision import Judgement
from turnmill_core.monitoring.features import Features, features
from turnmill_core.monitoring.gate import plain_comb
from turnmill_core.monitoring.growth import Surge
from turnmill_core.monitoring.separation import prepare, resampled_turns
from turnmill_core.monitoring.spectrum import LINE_RATIO, Array, Line
from turnmill_core.monitoring.speed import STEADY, Rotation
from turnmill_core.monitoring.verdict import ChatterKind, Reason

HEARD = 0.01
"""Share of its own and the synchronous energy that chatter must have in a channel that confirms it."""

GROWN = 2.0
"""Energy at the end of a window over the mean one there from which a line grows."""

AUDIBLE = 1e-3
"""Share that a channel must be able to tell from its noise, or its silence says nothing."""


@dataclass(frozen=True)
class Agreement:
    """Other channels that hear the same chatter, that would hear it and do not; names of both.

    The rest say nothing: they do not see the cut, or their noise is too loud.
    """

    confirm: tuple[str, ...] = ()
    deny: tuple[str, ...] = ()

    @property
    def denied(self) -> bool:
        """True where no other channel hears it and at least one would."""
        return bool(self.deny) and not self.confirm


def ask(f: Features, kind: ChatterKind, surge: Surge | None, others: Iterable[tuple[str, Array]], rate: float,
        turned: Rotation, teeth: int, band: tuple[float, float]) -> Agreement:
    """What other channels say of the chatter in a window's features.

    f: of the judged channel; kind: HOPF, its chatter family is looked for, or FLIP, half-order lines are; surge: line
    that grows at the end of the window, if that is all there is; others: names and samples (n,) of the same window at
    `rate` [Hz]; turned: the tool's rotation there; teeth: equal parts of a revolution; band [Hz]: in which lines are
    judged.
    """
    confirm, deny = list[str](), list[str]()
    for name, x in others:
        p = prepare(x, rate, band[1])
        turns = resampled_turns(turned.turns, len(p.samples), p.rate / rate)
        g = features(p, turns, turned.spread < STEADY, teeth, band[0], f.speed_ratio, (f.speed_ratio, f.speed_ratio),
                     surges=surge is not None)
        same = _half_order(g) if kind is ChatterKind.FLIP else _family(f, g, teeth) if surge is None else _grown(
            surge.frequency, g)
        if same > HEARD * (same + g.synchronous):
            confirm.append(name)
        elif same == 0.0 and plain_comb(g) and _audible(g, p.top - band[0]):
            deny.append(name)
    return Agreement(tuple(confirm), tuple(deny))


def asked(config: ChatterConfig, judgement: Judgement) -> bool:
    """True for a judgement that other channels can confirm or deny."""
    return judgement.kind is ChatterKind.HOPF or (judgement.kind is ChatterKind.FLIP and config.odd)


def with_others(judgement: Judgement, heard: Agreement) -> Judgement:
    """Judgement of the window after the other channels have been asked: a faint one needs one that confirms it."""
    if judgement.faint and not heard.confirm:
        return replace(judgement, kind=ChatterKind.MARGINAL, text=f"{judgement.text}; no other channel confirms it")
    if heard.denied:
        names = ", ".join(heard.deny)
        return replace(judgement, kind=ChatterKind.MARGINAL, reason=Reason.DENIED,
                       text=f"{judgement.text}; in this channel alone, not in {names}")
    if heard.confirm:
        return replace(judgement, text=f"{judgement.text}; heard by {', '.join(heard.confirm)} too")
    return judgement


def _family(f: Features, g: Features, teeth: int) -> float:
    """Energy that features `g` hold of the chatter family of `f`."""
    if f.chatter is None:
        return 0.0
    tooth, tolerance = teeth * f.frequency, 2 / f.seconds
    return sum(x.energy for x in g.lines if any(
        distance(x.frequency, m * f.chatter.frequency, tooth) <= tolerance for m in (1.0, 2.0, 3.0)))


def _grown(frequency: float, g: Features) -> float:
    """Energy at the end of the window of a line near a frequency [Hz] in features `g`, if it is GROWN there."""
    def nearby(found: tuple[Line, ...]) -> float:
        return max((x.energy for x in found if abs(x.frequency - frequency) < 2 / g.seconds), default=0.0)

    end = nearby(g.rising)
    return end if end > GROWN * nearby(g.lines) else 0.0


def _half_order(g: Features) -> float:
    """Energy of half-order lines in features `g`, none where noise may be all of it."""
    return g.own_half if g.own_half > AUDIBLE * g.synchronous else 0.0


def _audible(g: Features, width: float) -> bool:
    """Whether a line of AUDIBLE of the synchronous energy would stand out of the noise of features `g`.

    width [Hz]: of the band over which the noise is spread; a line fills two reciprocal window lengths.
    """
    return LINE_RATIO * g.noise * 2 / (g.seconds * width) < AUDIBLE * g.synchronous
