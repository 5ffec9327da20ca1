"""The message definitions, and real rclpy typesupport made from them."""

from __future__ import annotations

import array
import json
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from turnmill_core.monitoring.blocks import Status
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource
from turnmill_core.prediction import PredictedType

MESSAGES = Path(str(files("turnmill_ros"))) / "msg_schemas"
NAMES = sorted(str(p.relative_to(MESSAGES)) for kind in ("msg", "srv") for p in (MESSAGES / kind).iterdir())
# Every physical quantity begins its comment with its unit; counts, ids and words have none.
UNIT = re.compile(r"^(1|Hz|rad/s|m|s|N|N m|W|m/s|m3/s|channel's unit)(, |; |$)|, (channel|quantity)'s unit$")


@dataclass(frozen=True)
class Line:
    """A field or constant of a definition."""

    type: str
    name: str
    value: str
    comment: str


def lines(text: str) -> list[Line]:
    """Fields and constants of a definition."""
    found = []
    for raw in text.splitlines():
        declaration, _, comment = raw.partition("#")
        if declaration.split() and declaration.strip() != "---":
            kind, rest = declaration.split(maxsplit=1)
            name, _, value = rest.strip().partition("=")
            found.append(Line(kind, name, value, comment.strip()))
    return found


def constants(message: str, prefix: str = "") -> dict[str, int]:
    """Constants of a message, with the prefix taken off."""
    text = (MESSAGES / "msg" / f"{message}.msg").read_text(encoding="utf-8")
    return {c.name.removeprefix(prefix): int(c.value) for c in lines(text) if c.value and c.name.startswith(prefix)}


def test_all_definitions_are_built_and_carried() -> None:
    cmake = (MESSAGES / "CMakeLists.txt").read_text(encoding="utf-8")
    assert sorted(re.findall(r'"((?:msg|srv)/\w+\.\w+)"', cmake)) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_field_tells_meaning_and_unit(name: str) -> None:
    found = lines((MESSAGES / name).read_text(encoding="utf-8"))
    assert found
    for line in found:
        explained = line.comment or (line.value and re.fullmatch(r"(REASON|STATUS|TYPE)_\w+", line.name))
        assert explained or line.type == "std_msgs/Header", f"{name}: {line.name} has no comment"
        if re.match(r"float(32|64)|geometry_msgs/Vector3", line.type) and line.name != "samples":
            assert UNIT.search(line.comment), f"{name}: the comment of {line.name} does not begin with its unit"


def test_constants_are_append_only() -> None:
    first = {
        "ChatterState": "UNKNOWN AIR STABLE MARGINAL HOPF FLIP FLIP_OR_RUNOUT",
        "StabilityMargin": "TYPE_UNKNOWN TYPE_NO_CUT TYPE_STABLE TYPE_HOPF TYPE_FLIP",
    }
    for message, names in first.items():
        now = constants(message)
        assert [now[name] for name in names.split()] == list(range(len(names.split())))
    assert constants("SensorChannel", "STATUS_") == {"OK": 0, "SATURATED": 1, "DEAD": 2, "UNCALIBRATED": 4}
    assert constants("ChatterState")["REASON_PERSISTENCE"] == 16


def test_the_core_has_the_same_numbers() -> None:
    chatter = constants("ChatterState")
    states = {name: value for name, value in chatter.items() if not name.startswith(("REASON_", "SPEED_"))}
    assert {k.name: int(k) for k in ChatterKind} == states
    assert {r.name: int(r) for r in Reason} == constants("ChatterState", "REASON_")
    assert {s.name: int(s) for s in SpeedSource} == constants("ChatterState", "SPEED_")
    assert {t.name: int(t) for t in PredictedType} == constants("StabilityMargin", "TYPE_")
    assert {name: int(s) for name, s in Status.__members__.items()} == constants("SensorChannel", "STATUS_")


def share() -> Path:
    """share/turnmill_msgs of the installed wheel."""
    pytest.importorskip("turnmill_msgs", reason="not installed: pip install ./msg_schemas/turnmill_msgs")
    return Path(sys.prefix) / "share" / "turnmill_msgs"


@pytest.mark.ros
@pytest.mark.parametrize("name", NAMES)
def test_the_installed_typesupport_is_of_these_definitions(name: str) -> None:
    installed = (share() / name).read_text(encoding="utf-8")
    assert installed == (MESSAGES / name).read_text(encoding="utf-8"), "stale: pip install ./msg_schemas/turnmill_msgs"


@pytest.mark.ros
@pytest.mark.parametrize("name", [n for n in NAMES if n.startswith("msg")])
def test_type_hashes_agree_with_rosbags(name: str) -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = {}
    for message in (n for n in NAMES if n.startswith("msg")):
        text = (MESSAGES / message).read_text(encoding="utf-8")
        types |= get_types_from_msg(text, f"turnmill_msgs/msg/{Path(message).stem}")
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(types)
    described = json.loads((share() / name).with_suffix(".json").read_text(encoding="utf-8"))
    wanted = {h["type_name"]: h["hash_string"] for h in described["type_hashes"]}
    type_name = f"turnmill_msgs/msg/{Path(name).stem}"
    assert store.hash_rihs01(type_name) == wanted[type_name]


PUBLISHER = """
import array, time, rclpy
from turnmill_msgs.msg import SensorBlock, SensorChannel

rclpy.init()
node = rclpy.create_node("publisher")
publisher = node.create_publisher(SensorBlock, "sensor_blocks", 10)
block = SensorBlock(device="daq", stream_id=7, first_sample=2**40, sample_rate=51200.0)
block.header.stamp.sec, block.header.stamp.nanosec = 12, 345678901
block.channels = [SensorChannel(name=f"c{k}", quantity="acceleration", unit="m/s2", location="spindle", status=k)
                  for k in range(5)]
block.samples = array.array("f", [k / 8 for k in range(5 * 1024)])
end = time.monotonic() + 30
while publisher.get_subscription_count() == 0 and time.monotonic() < end:
    time.sleep(0.01)
publisher.publish(block)
publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=10))
rclpy.shutdown()
"""


@pytest.mark.ros
def test_two_processes_exchange_a_sensor_block(ros_context: object) -> None:
    rclpy = pytest.importorskip("rclpy")
    from rclpy.executors import SingleThreadedExecutor
    from turnmill_msgs.msg import SensorBlock

    received: list[SensorBlock] = []
    node = rclpy.create_node("subscriber", context=ros_context)
    node.create_subscription(SensorBlock, "sensor_blocks", received.append, 10)
    executor = SingleThreadedExecutor(context=ros_context)
    executor.add_node(node)
    with subprocess.Popen([sys.executable, "-c", PUBLISHER]) as publisher:
        end = time.monotonic() + 40
        while not received and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        # The publisher waits for the acknowledgement, then leaves.
        assert publisher.wait(timeout=20) == 0
    executor.shutdown()
    node.destroy_node()

    assert len(received) == 1
    block = received[0]
    assert (block.device, block.stream_id, block.first_sample, block.sample_rate) == ("daq", 7, 2**40, 51200.0)
    assert (block.header.stamp.sec, block.header.stamp.nanosec) == (12, 345678901)
    assert [(c.name, c.unit, c.status) for c in block.channels] == [(f"c{k}", "m/s2", k) for k in range(5)]
    assert isinstance(block.samples, array.array)
    np.testing.assert_array_equal(np.frombuffer(block.samples, np.float32), np.arange(5 * 1024, dtype=np.float32) / 8)
