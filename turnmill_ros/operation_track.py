"""Which operation holds at which time."""

from __future__ import annotations

from bisect import insort

from turnmill_core.operation import Operation


class OperationTrack:
    """Operations by the acquisition time [ns] from which they hold; the first one holds from the beginning.

    Operations arrive on a topic of their own; going by stamp, every node and every replay changes over at the
    same sample.
    """

    def __init__(self) -> None:
        self._entries: list[tuple[int, int, Operation]] = []

    def add(self, stamp_ns: int, operation: Operation) -> None:
        """Note that `operation` holds from `stamp_ns` on; one that is known already changes nothing."""
        if not self._entries or self._entries[-1][2].sha256 != operation.sha256 or not operation.sha256:
            insort(self._entries, (stamp_ns, len(self._entries), operation))

    def at(self, stamp_ns: int) -> Operation | None:
        """Operation that holds at `stamp_ns`; None before any is known."""
        held = [entry for entry in self._entries[1:] if entry[0] <= stamp_ns]
        return held[-1][2] if held else self.first

    @property
    def first(self) -> Operation | None:
        """The operation that held first, or None."""
        return self._entries[0][2] if self._entries else None
