"""Gaps of the sample index as every subscriber counts them."""

from __future__ import annotations

from dataclasses import replace

from tests.bag_cases import RATE, ROWS, block
from turnmill_ros.block_counts import BlockCounts


def counted(*numbers: int) -> BlockCounts:
    counts = BlockCounts()
    for k in numbers:
        counts.add(block(k))
    return counts


def test_a_stream_without_gaps() -> None:
    counts = counted(0, 1, 2)
    assert counts.values() == {"blocks": 3, "samples": 3 * ROWS, "gaps": 0, "missing_samples": 0, "repeats": 0,
                               "restarts": 0}
    assert counts.trouble() is None
    assert counts.end_ns is not None
    assert counts.end_ns - block(0).stamp_ns == round(3 * ROWS / RATE * 1e9)


def test_missing_and_repeated_blocks_are_told_once() -> None:
    counts = counted(0, 1, 4, 4, 3, 5)
    assert counts.values()["gaps"] == 1
    assert counts.values()["missing_samples"] == 2 * ROWS
    assert counts.values()["repeats"] == 2
    assert counts.trouble() == f"3 breaks of the sample index, {2 * ROWS} samples missing so far"
    assert counts.trouble() is None


def test_a_restarted_device_is_no_gap() -> None:
    counts = counted(5)
    counts.add(replace(block(0), stream_id=2))
    assert counts.values() == {"blocks": 2, "samples": 2 * ROWS, "gaps": 0, "missing_samples": 0, "repeats": 0,
                               "restarts": 1}
