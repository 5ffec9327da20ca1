"""What a subscriber has received of sample streams: blocks, and gaps in their sample index."""

from __future__ import annotations

from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_ros.serialized import Extent


class BlockCounts:
    """Counts blocks, samples and breaks of the sample index over all devices; first and last stamp [ns]."""

    def __init__(self) -> None:
        self.blocks = self.samples = self.gaps = self.missing_samples = self.repeats = self.restarts = 0
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self._next: dict[str, tuple[int, int]] = {}
        self._told = 0

    def add(self, block: SensorBlock) -> None:
        """Count one block."""
        self.note(Extent(block.device, block.stream_id, block.first_sample, len(block.samples)))
        end = block.stamp_ns + round(len(block.samples) * 1e9 / block.sample_rate)
        self.start_ns = block.stamp_ns if self.start_ns is None else min(self.start_ns, block.stamp_ns)
        self.end_ns = end if self.end_ns is None else max(self.end_ns, end)

    def note(self, extent: Extent) -> None:
        """Count one block of which only the extent is known."""
        self.blocks += 1
        self.samples += extent.samples
        stream, expected = self._next.get(extent.device, (extent.stream_id, extent.first_sample))
        if stream != extent.stream_id:
            self.restarts += 1
            expected = extent.first_sample
        if extent.first_sample > expected:
            self.gaps += 1
            self.missing_samples += extent.first_sample - expected
        elif extent.first_sample < expected:
            self.repeats += 1
        self._next[extent.device] = (extent.stream_id, max(extent.first_sample + extent.samples, expected))

    def values(self) -> dict[str, int]:
        """Counts by name."""
        return {"blocks": self.blocks, "samples": self.samples, "gaps": self.gaps,
                "missing_samples": self.missing_samples, "repeats": self.repeats, "restarts": self.restarts}

    def trouble(self) -> str | None:
        """What went wrong since this was asked last, in words."""
        total = self.gaps + self.repeats
        new, self._told = total - self._told, total
        return f"{new} breaks of the sample index, {self.missing_samples} samples missing so far" if new else None
