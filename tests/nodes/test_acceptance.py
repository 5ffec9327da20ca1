"""Full counts of the live graph; left to `make verify`."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_ros.analysis import analyze
from turnmill_ros.bag import read_bag
from turnmill_ros.conversions import verdict_from_message
from turnmill_ros.replay import replay, run_live

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def test_thirty_seconds_of_five_channels_in_separate_processes(tmp_path: Path, ros_domain: int) -> None:
    op = read_operation(shipped_operations()["demo_turn_milling"])
    path = tmp_path / "live.mcap"
    live = run_live(op, duration=30.0, separate_processes=True, output=path, sample_rate=51200.0, channels=5)
    assert live.sent == live.received == live.judged == live.recorded
    assert live.sent in range(1497, 1501)
    assert len(list(read_bag(path, ["sensor_blocks"]))) == live.sent
    again = replay(path, rate=math.inf, output=tmp_path / "again.mcap", separate_processes=True)
    assert again.sent == again.received == again.judged == again.recorded == live.sent
    expected = [repr(v) for v in live.verdicts]
    assert [repr(verdict_from_message(m.message)) for m in read_bag(path, ["chatter_state"])] == expected
    assert [repr(v) for v in again.verdicts] == expected
    assert [repr(v) for v in analyze(path).verdicts] == expected
