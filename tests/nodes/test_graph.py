"""The whole graph, each node in a process of its own: live, replayed, interrupted, with a node that dies."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import pytest

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_ros.analysis import analyze
from turnmill_ros.bag import bag_info, check_bag, read_bag
from turnmill_ros.conversions import axes_from_message, verdict_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.graph import GraphError, GraphResult
from turnmill_ros.replay import replay, run_live

pytestmark = pytest.mark.ros
SECONDS = 5.0


def operation() -> Operation:
    """The demonstration with its schedule shortened: air, cut and chatter within a few seconds."""
    text = shipped_operations()["demo_turn_milling"].read_text(encoding="utf-8")
    head = text[: text.index("schedule:")]
    points = ((0, -0.2), (0.8, -0.2), (1.0, 2), (2.5, 2), (2.7, 4), (6, 4))
    lines = (f"  - {{time: {t} s, tool_speed: 3025 rpm, workpiece_speed: 6 rpm, depth: {d} mm}}\n" for t, d in points)
    return parse_operation(head + "schedule:\n" + "".join(lines), "short")


def recorded(path: Path) -> list[Verdict]:
    return [verdict_from_message(m.message) for m in read_bag(path, ["chatter_state"])]


def differences(left: Sequence[Verdict], right: Sequence[Verdict]) -> list[tuple[int, str, object, object]]:
    """Where two runs differ: window, field, both values; a number that is not there equals one that is not there."""
    assert len(left) == len(right)
    return [(k, field.name, a, b) for k, pair in enumerate(zip(left, right, strict=True)) for field in fields(Verdict)
            if repr(a := getattr(pair[0], field.name)) != repr(b := getattr(pair[1], field.name))]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> tuple[GraphResult, Path, list[Verdict]]:
    """Five channels at 51.2 kHz in blocks of 20 ms, each node in its own process."""
    path, seen = tmp_path_factory.mktemp("live") / "live.mcap", []
    result = run_live(operation(), duration=SECONDS, separate_processes=True, output=path, sample_rate=51200.0,
                      channels=5, on_verdict=seen.append)
    return result, path, seen


def test_every_block_arrives_is_judged_and_recorded(live: tuple[GraphResult, Path, list[Verdict]]) -> None:
    result, path, _ = live
    assert result.sent == result.received == result.judged == result.recorded
    assert SECONDS * 50 - 3 <= result.sent <= SECONDS * 50
    blocks = [m.message for m in read_bag(path, ["sensor_blocks"])]
    assert [b.first_sample for b in blocks] == [k * 1024 for k in range(result.sent)]
    assert len(blocks[0].channels) == 5
    assert not result.interrupted
    assert [f for f in check_bag(path) if f.severity == "error"] == []


def test_the_bag_holds_every_axis_state_and_every_verdict(live: tuple[GraphResult, Path, list[Verdict]]) -> None:
    result, path, seen = live
    states = [axes_from_message(m.message) for m in read_bag(path, ["joint_states"])]
    assert len(states) == int(result.values["controller"]["joint_states_sent"]) == round(SECONDS * 250) + 1
    op, start, period = operation(), states[0].stamp_ns, 4_000_000
    assert states == [axis_state_at(op, k * period * 1e-9, start + k * period) for k in range(len(states))]
    assert differences(seen, result.verdicts) == []
    assert differences(recorded(path), result.verdicts) == []
    last = result.verdicts[-1].window_end_ns
    assert 0 <= states[-1].stamp_ns - last < 100_000_000
    kinds = [v.state for v in result.verdicts]
    assert kinds.index(ChatterKind.AIR) < kinds.index(ChatterKind.STABLE) < kinds.index(ChatterKind.HOPF)
    assert bag_info(path).metadata["operation"]["yaml"] == operation().text
    hashes = {m.message.operation_hash for m in read_bag(path, ["chatter_state", "cutting_loads", "stability_margin"])}
    assert hashes == {operation().sha256}


def test_replay_and_analysis_give_the_live_verdicts(
    live: tuple[GraphResult, Path, list[Verdict]], tmp_path: Path, ros_domain: int,
) -> None:
    result, path, _ = live
    again = replay(path, rate=math.inf, output=tmp_path / "again.mcap")
    assert again.sent == again.received == again.judged == again.recorded == result.sent
    for name in ("force_predictor", "stability_monitor", "chatter_monitor", "recorder"):  # what the player waits for
        assert again.values[name]["taken /joint_states"] == again.values["player"]["sent joint_states"]
    assert differences(again.verdicts, result.verdicts) == []
    assert differences(recorded(tmp_path / "again.mcap"), result.verdicts) == []
    assert differences(analyze(path).verdicts, result.verdicts) == []
    assert differences(analyze(tmp_path / "again.mcap").verdicts, result.verdicts) == []
    inputs = ["operation", "joint_states", "sensor_blocks"]
    assert {t.name: t.count for t in bag_info(tmp_path / "again.mcap").topics if t.name[1:] in inputs} == {
        t.name: t.count for t in bag_info(path).topics if t.name[1:] in inputs}


def test_a_replay_with_another_operation_computes_its_predictions_anew(
    live: tuple[GraphResult, Path, list[Verdict]], tmp_path: Path, ros_domain: int,
) -> None:
    _, path, _ = live
    other = read_operation(shipped_operations()["thesis_table_4_9"])
    again = replay(path, other, rate=math.inf, output=tmp_path / "other.mcap", separate_processes=True)
    assert again.sent == again.judged == again.recorded
    stamps = [{v.prior.stamp_ns for v in result.verdicts if v.prior} for result in (again, live[0])]
    assert stamps[0] - stamps[1]
    assert differences(analyze(path, other).verdicts, again.verdicts) == []
    assert [m.message.sha256 for m in read_bag(tmp_path / "other.mcap", ["operation"])] == [other.sha256]


LIVE = """
import sys
from pathlib import Path
from tests.nodes.test_graph import operation
from turnmill_ros.replay import run_live
result = run_live(operation(), separate_processes=sys.argv[2] == "many", output=Path(sys.argv[1]), sample_rate=12800.0,
                  channels=2, on_verdict=lambda v: print(v.state.name, flush=True))
print("counts", result.sent, result.received, result.judged, result.recorded, len(result.verdicts),
      result.interrupted)
"""


@pytest.mark.parametrize("processes", ["one", "many"])
def test_ctrl_c_stops_in_order_and_leaves_a_complete_bag(
    processes: str, tmp_path: Path, ros_domain: int, project: Path,
) -> None:
    path = tmp_path / "live.mcap"
    process = subprocess.Popen([sys.executable, "-c", LIVE, str(path), processes], stdout=subprocess.PIPE, text=True,
                               cwd=project, start_new_session=True)
    assert process.stdout is not None
    for _ in range(10):
        assert process.stdout.readline().strip() in ChatterKind.__members__
    os.killpg(process.pid, signal.SIGINT)
    began = time.monotonic()
    told, _ = process.communicate(timeout=30)
    print(f"{processes}: stopped {time.monotonic() - began:.2f} s after Ctrl-C")
    assert process.returncode == 0
    _, sent, received, judged, kept, verdicts, interrupted = told.split("\n")[-2].split()
    assert sent == received == judged == kept
    assert interrupted == "True"
    assert sum(1 for _ in read_bag(path, ["sensor_blocks"])) == int(kept) > 20
    assert len(recorded(path)) == int(verdicts) >= 10


def test_a_node_that_dies_ends_the_run_and_leaves_a_complete_bag(tmp_path: Path, ros_domain: int) -> None:
    path, pids = tmp_path / "live.mcap", []

    def kill_one(verdict: Verdict) -> None:
        if not pids:
            pids.extend(_children_running("force_predictor"))
            os.kill(pids[0], signal.SIGKILL)

    with pytest.raises(GraphError, match=r"force_predictor.*signal 9"):
        run_live(operation(), duration=30.0, separate_processes=True, output=path, sample_rate=12800.0, channels=1,
                 on_verdict=kill_one)
    assert sum(1 for _ in read_bag(path, ["sensor_blocks"])) > 0
    assert _children_running("turnmill_ros.nodes") == []


def _children_running(word: str) -> list[int]:
    """Own child processes with `word` in their command line."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
            line = (folder / "cmdline").read_text().replace("\0", " ")
        except OSError:
            continue
        if parent == os.getpid() and word in line:
            found.append(int(folder.name))
    return found


def test_a_refusing_node_is_named_and_nothing_is_left_running(tmp_path: Path, ros_domain: int) -> None:
    with pytest.raises(InputError, match=r"process_simulator.*sample_rate"):
        run_live(operation(), duration=1.0, separate_processes=False, sample_rate=10.0)
    (tmp_path / "there.mcap").write_bytes(b"")
    with pytest.raises(InputError, match="output exists"):
        run_live(operation(), duration=1.0, output=tmp_path / "there.mcap")
    with pytest.raises(InputError, match="no such recording"):
        replay(tmp_path / "none.mcap")


def test_a_run_can_be_stopped_from_another_thread(tmp_path: Path, ros_domain: int) -> None:
    stop = threading.Event()
    result = run_live(operation(), output=tmp_path / "a.mcap", sample_rate=12800.0, channels=1, stop=stop,
                      on_verdict=lambda verdict: stop.set() if verdict.state is not ChatterKind.UNKNOWN else None)
    assert result.interrupted
    assert result.sent == result.received == result.judged == result.recorded > 0
