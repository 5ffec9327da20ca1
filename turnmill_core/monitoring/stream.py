"""One sample stream of one device: the newest blocks, and what is wrong with them.

Blocks are kept as they came, without copying; what lies before the next window is dropped, so the
memory is bounded. Windows end at multiples of the hop in the sample index, whatever the block size.
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.verdict import Reason

CLOCK_DRIFT_NS = 1_000_000
CLOCK_STEP_NS = 20_000_000
BEGUN = "fewer samples than one window since the stream began"


@dataclass(frozen=True)
class Break:
    """Samples [start, end) are missing (start == end: repeated, or the clock stepped there)."""

    start: int
    end: int
    text: str


@dataclass(frozen=True)
class Stream:
    """Blocks of one stream in order of index.

    sample_rate [Hz]; origin: index of its first sample; end: index after its last one; anchors: (sample, stamp ns),
    ascending, from which stamps are counted; next_end: index after the last sample of the next window.
    """

    device: str
    stream_id: int
    sample_rate: float
    channels: tuple[Channel, ...]
    origin: int
    end: int
    anchors: tuple[tuple[int, int], ...]
    next_end: int
    blocks: tuple[SensorBlock, ...] = ()
    breaks: tuple[Break, ...] = ()
    start_reason: Reason = Reason.WARMUP
    start_text: str = BEGUN

    def stamp(self, sample: int) -> int:
        """Acquisition time of a sample [ns]."""
        at, stamp = next((a for a in reversed(self.anchors) if a[0] <= sample), self.anchors[0])
        return stamp + round((sample - at) * 1e9 / self.sample_rate)


def open_stream(block: SensorBlock, hop: int, reason: Reason = Reason.WARMUP, text: str = BEGUN) -> Stream:
    """Stream that begins with `block` (which is not appended yet); hop in samples."""
    first = block.first_sample
    return Stream(block.device, block.stream_id, block.sample_rate, _plain(block.channels), first, first,
                  ((first, block.stamp_ns),), (first // hop + 1) * hop, start_reason=reason, start_text=text)


def continues(stream: Stream, block: SensorBlock) -> str:
    """Empty where `block` belongs to `stream`, else in words why a new stream begins."""
    if block.stream_id != stream.stream_id:
        return "the device restarted"
    if block.sample_rate != stream.sample_rate:
        return f"the sample rate changed from {stream.sample_rate:g} to {block.sample_rate:g} Hz"
    if _plain(block.channels) != stream.channels:
        return "the channels changed"
    return ""


def append(stream: Stream, block: SensorBlock, hop: int) -> Stream:
    """Stream with `block`: a gap, repeated samples or a clock step become a Break; hop in samples."""
    breaks, anchors, next_end = stream.breaks, stream.anchors, stream.next_end
    first, end = block.first_sample, block.end_sample
    if first > stream.end:
        breaks = (*breaks, Break(stream.end, first, f"{first - stream.end} samples are missing"))
        if next_end > stream.end:
            next_end = max(next_end, (first // hop + 1) * hop)
    elif first < stream.end:
        repeated = min(end, stream.end) - first
        if not (breaks and breaks[-1].start == breaks[-1].end == stream.end):
            breaks = (*breaks, Break(stream.end, stream.end, f"{repeated} samples came again or out of order"))
        if end <= stream.end:
            return replace(stream, breaks=breaks)
        block = _tail(block, stream.end)
        first = stream.end
    drift = block.stamp_ns - stream.stamp(first)
    if abs(drift) > CLOCK_DRIFT_NS:
        anchors = (*anchors, (first, block.stamp_ns))
        if abs(drift) > CLOCK_STEP_NS:
            breaks = (*breaks, Break(first, first, f"the clock stepped by {drift / 1e6:.0f} ms"))
    return replace(stream, end=end, anchors=anchors, next_end=next_end, blocks=(*stream.blocks, block), breaks=breaks)


def advance(stream: Stream, hop: int, longest: int) -> Stream:
    """Stream whose next window ends a hop later; blocks no window of `longest` samples needs are dropped.

    Windows whose last sample lies in a gap are left out: nothing was measured there.
    """
    next_end = stream.next_end + hop
    for gap in stream.breaks:
        if gap.start < next_end <= gap.end:
            next_end = (gap.end // hop + 1) * hop
    keep = next_end - longest
    newer = [a for a in stream.anchors if a[0] > keep]
    return replace(stream, next_end=next_end, anchors=(*stream.anchors[len(stream.anchors) - len(newer) - 1:],)
                   if len(newer) < len(stream.anchors) else stream.anchors,
                   blocks=stream.blocks[_first_after(stream.blocks, keep):],
                   breaks=tuple(b for b in stream.breaks if b.end > keep))


def _first_after(blocks: tuple[SensorBlock, ...], sample: int) -> int:
    """Index of the first block that ends after `sample`."""
    return bisect.bisect_right(blocks, sample, key=lambda b: b.end_sample)


def trouble(stream: Stream, start: int, end: int) -> tuple[Reason, str]:
    """Why window [start, end) cannot be judged as far as the stream goes, or (NONE, "")."""
    for b in stream.breaks:
        if start < b.end and end > b.start and (b.end > b.start or start < b.start):
            return Reason.GAP, b.text
    if start < stream.origin:
        return stream.start_reason, stream.start_text
    return Reason.NONE, ""


def samples(stream: Stream, start: int, end: int, channel: int) -> NDArray[np.float32]:
    """Samples [start, end) of one channel; the stream must hold them all."""
    return np.concatenate([b.samples[max(0, start - b.first_sample): end - b.first_sample, channel]
                           for b in _inside(stream, start, end)])


def status(stream: Stream, start: int, end: int, channel: int) -> Status:
    """Union of the status flags of one channel over window [start, end)."""
    flags = Status.OK
    for b in _inside(stream, start, end):
        flags |= b.channels[channel].status
    return flags


def _inside(stream: Stream, start: int, end: int) -> tuple[SensorBlock, ...]:
    """Blocks that hold samples of [start, end)."""
    return stream.blocks[_first_after(stream.blocks, start): _first_after(stream.blocks, end - 1) + 1]


def _plain(channels: tuple[Channel, ...]) -> tuple[Channel, ...]:
    """Channels without their status, which may change from block to block."""
    return channels if all(c.status is Status.OK for c in channels) else tuple(
        replace(c, status=Status.OK) for c in channels)


def _tail(block: SensorBlock, first: int) -> SensorBlock:
    skipped = first - block.first_sample
    return replace(block, first_sample=first, samples=block.samples[skipped:],
                   stamp_ns=block.stamp_ns + round(skipped * 1e9 / block.sample_rate))
