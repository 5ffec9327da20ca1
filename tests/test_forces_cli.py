"""The command forces: a cut, a path, and a recording with measured loads."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.test_cli import ask
from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import nominal_axes, with_cut
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.operation import Operation
from turnmill_ros.bag import BagWriter
from turnmill_ros.conversions import axes_to_message, block_to_message, operation_to_message, wrench_to_message
from turnmill_ros.force_compare import compare
from turnmill_ros.interfaces import rosbags_types
from turnmill_ros.measured import Source, sources_of, wrench_source
from turnmill_ros.operations import find_operation
from turnmill_ros.simulate import simulate_to_bag

START = 10**12
TYPES = rosbags_types()
CHANNELS = tuple(Channel(f"force_{a}", "force", "N", "dynamometer") for a in "xyz")


def operation() -> Operation:
    return find_operation("thesis_table_4_9", ["workpiece.length=20 mm"])


def recording(
    path: Path, op: Operation, scale: float, *, wrench: str = "", power: float | None = None, air: float = 0.0,
    offset: float = 0.0, status: Status = Status.OK,
) -> Path:
    """4 s of a steady cut after `air` seconds above the bar; measured loads are `scale` times the predicted ones."""
    loads = cutting_loads(op, op.conditions)
    with BagWriter(path, operation=op, versions={"turnmill": "test"}) as writer:
        writer.write("/operation", operation_to_message(op, START, TYPES), START)
        for k in range(200):
            stamp, time = START + k * 20_000_000, k * 0.02
            cut = time >= air
            axes = axis_state_at(op, time, stamp)
            if not cut:
                above = nominal_axes(op, with_cut(op, depth=-1e-3)).position
                axes = AxisState(stamp, (above[0], *axes.position[1:]), axes.velocity)
            writer.write("/joint_states", axes_to_message(axes, TYPES), stamp)
            if wrench:
                for j in range(10):
                    writer.write(wrench, wrench_to_message(
                        scale * cut * loads.force_machine_mean, np.zeros(3), stamp + j * 2_000_000, "machine", TYPES),
                        stamp + j * 2_000_000)
            elif power is not None:
                block = SensorBlock(stamp, "drive", 1, k, 50.0, (Channel("spindle", "power", "W", "", status),),
                                    np.full((1, 1), offset + cut * scale * loads.tool_power_mean, dtype=np.float32))
                writer.write("/sensor_blocks", block_to_message(block, TYPES), stamp)
            else:
                samples = np.tile(scale * cut * loads.force_tool_mean, (20, 1)).astype(np.float32)
                block = SensorBlock(stamp, "dyno", 1, 20 * k, 1000.0, CHANNELS, samples)
                writer.write("/sensor_blocks", block_to_message(block, TYPES), stamp + 19_000_000)
    return path


def test_a_cut_as_json_table_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    html = tmp_path / "forces.html"
    code, out, err = ask(capsys, "forces", "thesis_table_3_1", "--json", "--report", str(html))
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["bottom_share"] == pytest.approx(0.138, abs=1e-3)
    assert len(found["teeth"]) == 2
    assert found["teeth"][0]["chip_max_m"] == pytest.approx(0.434e-3, rel=0.01)
    arcs = found["engagement"]
    assert math.degrees(arcs[0]["arcs_rad"][0][1]) == pytest.approx(41.1, abs=0.1)
    assert arcs[0]["height_m"] < arcs[-1]["height_m"]
    page = html.read_text()
    assert all(words in page for words in (
        "Chip load", "Engagement map", "Along the edge", "machine frame", "Torque on the tool spindle"))
    code, out, _ = ask(capsys, "forces", "thesis_table_3_1", "--chip", "exact", "--bottom")
    assert code == 0
    assert "through the tool" in out


def test_other_tools_have_forces_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = ask(capsys, "forces", "thesis_table_3_1", "--set", "tool.shape={corner_radius: 2 mm}",
                         "--set", "tool.flute_length=20 mm", "--json", "--report", str(tmp_path / "f.html"))
    assert (code, err) == (0, "")
    assert json.loads(out)["in_cut"]


@pytest.mark.parametrize(("kind", "engagement"), [("orthogonal", "closed"), ("tangential", "swept")])
def test_along_a_path(kind: str, engagement: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = ("--set", "workpiece.length=20 mm", "--set", "tool.flute_length=30 mm", "--set",
               "cut.workpiece_speed=20rpm")
    file, html = tmp_path / "path.cls", tmp_path / "path.html"
    ask(capsys, "toolpath", "--generate", kind, "--operation", "thesis_table_3_1", *changes, "--write", str(file))
    code, out, err = ask(capsys, "forces", "thesis_table_3_1", *changes, "--path", str(file), "--rate", "2Hz", "--json",
                         "--report", str(html))
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["engagement"] == engagement
    assert found["refused"] == []
    assert any(found["in_cut"])
    assert not found["in_cut"][0]
    assert len(found["force_workpiece_mean_n"]) == len(found["time_s"])
    assert "workpiece frame (turns with C)" in html.read_text()
    code, out, _ = ask(capsys, "forces", "thesis_table_3_1", *changes, "--path", str(file), "--rate", "1Hz",
                       "--engagement", "closed")
    assert code == 0
    assert ("no prediction at" in out) == (kind == "tangential")


@pytest.mark.parametrize("wrench", ["", "/wrench/measured", "/cell/dynamometer"])
def test_measured_forces_beside_predicted(
    wrench: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = recording(tmp_path / "cut.mcap", operation(), 1.15, wrench=wrench)
    html = tmp_path / "compare.html"
    code, out, err = ask(capsys, "forces", "--compare", str(bag), "--json", "--report", str(html))
    assert (code, err) == (0, "")
    source = json.loads(out)["sources"][0]
    assert source["name"] == (wrench.strip("/") or "dyno: force_x, force_y, force_z")
    assert source["frame"] == ("machine" if wrench else "tool")
    assert source["windows"][-1]["scale"] == pytest.approx(1.15, rel=1e-6)
    assert source["windows"][0]["reason"].startswith("fewer than 3 windows")
    assert source["windows"][0]["scale"] is None
    page = html.read_text()
    assert "Scale of the force coefficients" in page
    code, out, _ = ask(capsys, "forces", "--compare", str(bag))
    assert code == 0
    assert "1.15" in out


def test_a_simulated_recording_gives_a_scale_of_one(tmp_path: Path) -> None:
    """The simulator computes forces by its own integration in time."""
    op = find_operation("thesis_table_3_1", ["cut.tool_speed=3000 rpm", "cut.workpiece_speed=12 rpm"])
    bag = tmp_path / "cut.mcap"
    simulate_to_bag(op, bag, duration=1.5, channels=("force_x", "force_y", "force_z"))
    (windows,) = compare(bag).windows.values()
    assert windows[-1].scale == pytest.approx(1.0, abs=0.002)
    assert windows[-1].lower < 1.0 < windows[-1].upper
    assert windows[-1].measured == pytest.approx(windows[-1].predicted, abs=0.2)


def test_spindle_power_with_its_idle_level(tmp_path: Path) -> None:
    op = operation()
    (windows,) = compare(recording(tmp_path / "power.mcap", op, 0.8, power=1.0, air=1.0, offset=120.0)).windows.values()
    assert {w.reason for w in windows[:4]} == {"no cut"}
    assert windows[-1].scale == pytest.approx(0.8, rel=1e-3)
    assert windows[-1].offset == pytest.approx([120.0], abs=0.1)
    (constant,) = compare(recording(tmp_path / "no_air.mcap", op, 0.8, power=1.0, offset=120.0)).windows.values()
    assert math.isnan(constant[-1].scale)
    assert "level without a cut is not known" in constant[-1].reason


def test_what_cannot_be_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    op, silent, dead = operation(), tmp_path / "silent.mcap", tmp_path / "dead.mcap"
    recording(dead, op, 1.0, power=1.0, status=Status.DEAD)
    with BagWriter(silent, operation=op, versions={"turnmill": "test"}) as writer:
        writer.write("/operation", operation_to_message(op, START, TYPES), START)
        writer.write("/joint_states", axes_to_message(axis_state_at(op, 0.0, START), TYPES), START)
    for bag in (silent, dead):
        code, out, err = ask(capsys, "forces", "--compare", str(bag))
        assert (code, out) == (2, "")
        assert "nothing measured" in err
    for arguments, words in (
        ((), "give an OP"), (("--compare", "nowhere.mcap"), "nowhere.mcap"),
        (("thesis_table_3_1", "--path", "nowhere.cls"), "nowhere.cls"),
        (("thesis_table_3_1", "--path", "a", "--compare", "b"), "do not go together"),
        (("--compare", str(dead), "--depth", "1mm"), "leave speeds and depth out"),
        (("thesis_table_3_1", "--path", "a", "--depth", "1mm"), "those of the path"),
    ):
        code, _, err = ask(capsys, "forces", *arguments)
        assert code == 2
        assert words in err


def test_a_negative_feed_and_a_bad_path_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bad.cls"
    for text, words in (("FEDRAT/-100,MMPM\nGOTO/0,0,0\n", "line 1: feed is -100"), ("GOTO/1,2\n", "line 1"),
                        ("GOTO/0,0,0\nGOTO/10,0,0\n", "feed to path point 2"), ("GOTO/0,0,0\n", "no motion")):
        file.write_text(text)
        code, out, err = ask(capsys, "forces", "thesis_table_3_1", "--path", str(file))
        assert (code, out) == (2, "")
        assert words in err
    code, _, err = ask(capsys, "forces", "thesis_table_3_1", "--set", "cut.axial_feed=-1 mm/rev")
    assert code == 2
    assert "cut.axial_feed" in err


def test_channels_are_told_apart() -> None:
    channels = (Channel("machine_Fz", "force", "N"), Channel("machine_Fx", "force", "N"), Channel("fy", "force", "N"),
                Channel("load", "force", "N"), Channel("torque", "torque", "N m"),
                Channel("c_power", "power", "W", "workpiece spindle"), Channel("mic", "sound_pressure", "Pa"))
    block = SensorBlock(0, "daq", 1, 0, 1000.0, channels, np.zeros((4, 7), dtype=np.float32))
    assert sources_of(block) == [
        (Source("daq: fy", "force", "tool", (1,)), [2]),
        (Source("daq: machine_Fx, machine_Fz", "force", "machine", (0, 2)), [1, 0]),
        (Source("daq: torque", "torque"), [4])]
    assert wrench_source("/cell/dyno", "cell/machine") == Source("cell/dyno", "force", "machine", (0, 1, 2))
    assert wrench_source("/dyno", "").frame == "tool"
