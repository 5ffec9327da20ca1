"""The recorder: everything is in the file, whatever ends it."""

from __future__ import annotations

import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from tests.bag_cases import block, operation
from tests.nodes.ros_tools import Probe, launch
from turnmill_ros import topics
from turnmill_ros.bag import bag_info, read_bag, recover
from turnmill_ros.conversions import block_to_message, operation_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support

pytestmark = pytest.mark.ros


def start(probe: Probe, process: subprocess.Popen[str]) -> None:
    """Wait until a recorder in another process listens."""
    probe.announce(topics.SENSOR_BLOCKS, topics.OPERATION)
    probe.publish(topics.OPERATION, operation_to_message(operation(), 5, ros_types()))
    ready = probe.until(lambda: process.poll() is not None or probe.value("recorder", "phase") == "active")
    assert ready
    assert process.poll() is None, process.stderr and process.stderr.read()
    assert probe.until(lambda: probe.out[topics.SENSOR_BLOCKS.name].get_subscription_count() == 1)


def feed(probe: Probe, numbers: range, rows: int = 128, pause: float = 0.0) -> None:
    for k in numbers:
        probe.publish(topics.SENSOR_BLOCKS, block_to_message(block(k, rows), ros_types()))
        probe.until(lambda: False, pause)


def firsts(path: Path) -> list[int]:
    return [int(m.message.first_sample) for m in read_bag(path, ["sensor_blocks"])]


def test_sigint_leaves_a_complete_recording(probe: Probe, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    process = launch("recorder", tmp_path, bag=str(path))
    start(probe, process)
    feed(probe, range(100))
    assert support.wait_until_acknowledged(probe, 20.0)  # what is on its way to it, a node cannot write
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    assert firsts(path) == [k * 128 for k in range(100)]
    assert bag_info(path).metadata["operation"]["sha256"] == operation().sha256
    assert not path.with_name("a.mcap.part").exists()


def test_kill_loses_less_than_the_last_second(probe: Probe, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    process = launch("recorder", tmp_path, bag=str(path))
    start(probe, process)
    sent: list[float] = []
    for k in range(150):
        sent.append(time.time())
        feed(probe, range(k, k + 1), pause=0.02)
    killed = time.time()
    process.kill()
    process.wait(20)
    part = path.with_name("a.mcap.part")
    assert part.exists()
    assert not path.exists()
    recover(part, tmp_path / "saved.mcap")
    saved = firsts(tmp_path / "saved.mcap")
    assert saved == [k * 128 for k in range(len(saved))]
    assert killed - sent[len(saved)] < 1.0 if len(saved) < len(sent) else saved


def test_a_full_disk_is_told_and_what_was_written_stays_readable(probe: Probe, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    limit = 300_000
    process = launch("recorder", tmp_path, bag=str(path),
                     limit=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    start(probe, process)
    for k in range(400):
        if process.poll() is not None:
            break
        feed(probe, range(k, k + 1), rows=128, pause=0.005)
    assert process.wait(20) == 1
    probe.until(lambda: False, 0.2)
    failed = [s for s in probe.statuses("recorder") if s.level == DiagnosticStatus.ERROR]
    assert failed
    assert "disk is full" in failed[-1].message
    kept = firsts(path)
    assert len(kept) > 50
    assert kept == [k * 128 for k in range(len(kept))]
    assert path.stat().st_size <= limit


def test_an_existing_file_is_refused(probe: Probe, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"mine")
    process = launch("recorder", tmp_path, bag=str(tmp_path / "a.mcap"))
    assert process.wait(30) == 1
    assert process.stderr is not None
    assert "output exists" in process.stderr.read()
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"


def test_messages_before_the_first_clock_are_kept(probe: Probe, tmp_path: Path) -> None:
    from turnmill_ros.conversions import clock_to_message
    from turnmill_ros.nodes._support import start as activate
    from turnmill_ros.nodes.recorder import Recorder

    path = tmp_path / "a.mcap"
    recorder: Any = probe.add(Recorder, bag=str(path), use_sim_time=True)
    assert activate(recorder)
    probe.announce(topics.SENSOR_BLOCKS, topics.CLOCK)
    assert probe.until(lambda: probe.out["/clock"].get_subscription_count() == 1
                       and probe.out["sensor_blocks"].get_subscription_count() == 1)
    feed(probe, range(3), pause=0.05)
    for k in range(40):
        probe.publish(topics.CLOCK, clock_to_message(1_000_000_000 + k, ros_types()))
        probe.until(lambda: False, 0.02)
    feed(probe, range(3, 5), pause=0.05)
    recorder.trigger_deactivate()
    assert firsts(path) == [k * 128 for k in range(5)]
    assert {m.log_time_ns // 1000 for m in read_bag(path, ["sensor_blocks"])} == {1_000_000}
