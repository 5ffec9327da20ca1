"""Which channel of a window is judged, and whether its samples can be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring import stream as streams
from turnmill_core.monitoring.blocks import Channel, Status
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.sensors import implausible
from turnmill_core.monitoring.stream import Stream
from turnmill_core.monitoring.verdict import Reason
from turnmill_core.operation_sensors import TIP_CHANNELS

Floats = NDArray[np.float64]


def choose(config: ChatterConfig, s: Stream, start: int, end: int) -> tuple[int, Floats, Reason, str]:
    """Index and samples of the judged channel, and why it cannot be judged (NONE where it can)."""
    names = [c.name for c in s.channels]
    if config.channel and config.channel not in names and not (config.fallback and config.channel in TIP_CHANNELS):
        return 0, np.zeros(0), Reason.BAD_SAMPLES, f"no channel {config.channel!r} among {', '.join(names)}"
    chosen = names.index(config.channel) if config.channel in names else 0
    first: tuple[int, Floats, Reason, str] | None = None
    others = [k for k in range(len(names)) if k != chosen] if config.fallback or not config.channel else []
    for k in (chosen, *others):
        x = streams.samples(s, start, end, k)
        reason, text = usable(x, streams.status(s, start, end, k), s.channels[k])
        if reason is Reason.NONE:
            return k, x.astype(np.float64), reason, text
        first = first or (k, x.astype(np.float64), reason, text)
    assert first is not None
    return first


def others(s: Stream, start: int, end: int, judged: str) -> Iterator[tuple[str, Floats]]:
    """Names and samples of the channels in window [start, end), other than the judged one, that can be judged too."""
    for k, channel in enumerate(s.channels):
        if channel.name != judged:
            x = streams.samples(s, start, end, k)
            if usable(x, streams.status(s, start, end, k), channel)[0] is Reason.NONE:
                yield channel.name, x.astype(np.float64)


def usable(x: NDArray[np.float32], status: Status, channel: Channel) -> tuple[Reason, str]:
    """Why the samples x (n,) of a channel cannot be judged, NONE where they can, and in words."""
    name = channel.name
    if not np.isfinite(x).all():
        return Reason.BAD_SAMPLES, f"channel {name} holds values that are no numbers"
    low, high = float(x.min()), float(x.max())
    if status & Status.DEAD or low == high:
        return Reason.BAD_SAMPLES, f"channel {name} is dead"
    wrong = implausible(channel, low, high)
    if wrong:
        return Reason.BAD_SAMPLES, f"channel {name}: {wrong}"
    if status & Status.SATURATED or _clipped(x, low, high):
        return Reason.SATURATED, f"channel {name} is saturated"
    return Reason.NONE, ""


def _clipped(x: NDArray[np.float32], low: float, high: float) -> bool:
    """True where the extremes are held: at least 0.2 % of the samples equal an extreme, mostly in runs."""
    for extreme in (low, high):
        at = np.flatnonzero(x == extreme)
        held = len(at) >= max(8, 0.002 * len(x)) and np.mean(np.diff(at) == 1) > 0.4
        if held and abs(extreme) >= 0.99 * max(-low, high):
            return True
    return False
