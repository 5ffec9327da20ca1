"""The player and readers that are slower than it: it does not run ahead of them, and nothing is lost."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from tests.bag_cases import block, write
from tests.nodes.ros_tools import Probe
from turnmill_ros import topics
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes.player import AHEAD, Player, Reader

pytestmark = pytest.mark.ros
BLOCKS = 3 * AHEAD


def test_a_reader_lags_by_what_was_sent_since_it_was_there() -> None:
    late = Reader(taken={"/joint_states": 30}, missed={"/joint_states": 1000}, told=0.0)
    assert late.lags("/joint_states", 1100) == 70
    assert late.lags("/sensor_blocks", 1100) == 0


def test_the_player_does_not_run_ahead_of_a_slow_reader(probe: Probe, tmp_path: Path) -> None:
    path = write(tmp_path / "in.mcap", (block(k, rows=8) for k in range(BLOCKS)), with_axes=False)
    player = probe.add(Player, bag=str(path), rate=0.0, match=["sensor_blocks=1"])
    heard: list[int] = []
    behind: list[int] = []

    def slowly(message: Any) -> None:
        time.sleep(1e-4)
        heard.append(message.first_sample)
        behind.append(player._sent["/sensor_blocks"] - len(heard))

    probe.diagnostics = support.Diagnostics(probe, dict, paced=True)
    support.subscription(probe, topics.SENSOR_BLOCKS, slowly, always=True)
    assert probe.until(lambda: "probe" in player._readers)
    assert support.start(player)
    assert probe.until(lambda: len(heard) == BLOCKS)
    assert heard == sorted(set(heard))
    assert AHEAD / 4 < max(behind) <= AHEAD + 1
    player.trigger_deactivate()
