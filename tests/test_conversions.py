"""Values to messages and back, through serialized bytes; and the same for ROS' own classes."""

from __future__ import annotations

import math
import re
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnmill_core.cutting.loads import cutting_loads
from turnmill_core.machine.axes import AXES, AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.prediction import PredictedType, Prior
from turnmill_core.stability.margin import Lobes, Margin
from turnmill_ros import conversions
from turnmill_ros.decoding import decoder
from turnmill_ros.interfaces import own_texts, ros_types, rosbags_types, schema_text, typestore

TYPES = rosbags_types()
STAMPS = st.integers(min_value=0, max_value=2**31 * 1_000_000_000 - 1)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)


def _through_bytes(message):
    name = message.__msgtype__
    return typestore().deserialize_cdr(bytes(typestore().serialize_cdr(message, name)), name)


def _same(left, right) -> bool:
    """Equality in which NaN equals NaN."""
    if isinstance(left, float) and isinstance(right, float):
        return left == right or (math.isnan(left) and math.isnan(right))
    if isinstance(left, tuple):
        return len(left) == len(right) and all(map(_same, left, right))
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and np.array_equal(left, right, equal_nan=True)
    if hasattr(left, "__dataclass_fields__"):
        pairs = ((getattr(left, f.name), getattr(right, f.name)) for f in fields(left))
        return type(left) is type(right) and all(_same(*pair) for pair in pairs)
    return left == right


@st.composite
def blocks(draw):
    channels = tuple(
        Channel(draw(TEXTS), draw(TEXTS), draw(TEXTS), draw(TEXTS), Status(draw(st.integers(0, 7))))
        for _ in range(draw(st.integers(1, 4))))
    rows = draw(st.integers(0, 20))
    values = draw(st.lists(st.floats(width=32), min_size=rows * len(channels), max_size=rows * len(channels)))
    return SensorBlock(
        draw(STAMPS), draw(TEXTS), draw(st.integers(0, 2**32 - 1)), draw(st.integers(0, 2**64 - 1)),
        draw(st.floats(0.1, 1e6)), channels, np.array(values, dtype=np.float32).reshape(rows, len(channels)))


PRIORS = st.none() | st.builds(Prior, STAMPS, st.sampled_from(PredictedType), NUMBERS, NUMBERS)
VERDICTS = st.builds(
    Verdict, STAMPS, STAMPS, st.integers(0, 2**64 - 1), TEXTS, st.integers(0, 2**32 - 1), TEXTS,
    st.sampled_from(ChatterKind), st.sampled_from(Reason), TEXTS, NUMBERS, st.lists(NUMBERS, max_size=5).map(tuple),
    NUMBERS, NUMBERS, st.sampled_from(SpeedSource), NUMBERS, NUMBERS, NUMBERS, NUMBERS, PRIORS)
SIX = st.tuples(*[NUMBERS] * 6)
AXIS_STATES = st.builds(AxisState, STAMPS, SIX, SIX)


@given(blocks())
@settings(deadline=None, max_examples=60)
def test_block_survives_the_wire(block):
    back = conversions.block_from_message(_through_bytes(conversions.block_to_message(block, TYPES)))
    assert _same(block, back)
    assert not back.samples.flags.writeable


@given(VERDICTS)
@settings(deadline=None, max_examples=100)
def test_verdict_survives_the_wire(verdict):
    message = _through_bytes(conversions.verdict_to_message(verdict, "abc", TYPES))
    assert _same(verdict, conversions.verdict_from_message(message))
    assert message.operation_hash == "abc"
    assert conversions.time_from_message(message.header.stamp) == verdict.window_end_ns


@given(AXIS_STATES)
@settings(deadline=None, max_examples=60)
def test_axis_state_survives_the_wire(state):
    assert _same(state, conversions.axes_from_message(_through_bytes(conversions.axes_to_message(state, TYPES))))


@given(st.integers(min_value=-(2**31) * 10**9, max_value=2**31 * 10**9 - 1))
@settings(deadline=None)
def test_time_keeps_every_nanosecond(stamp_ns):
    message = conversions.time_to_message(stamp_ns, TYPES)
    assert conversions.time_from_message(message) == stamp_ns
    assert 0 <= message.nanosec < 10**9


def test_time_out_of_range_is_refused():
    with pytest.raises(ValueError, match="32 bits"):
        conversions.time_to_message(2**31 * 10**9, TYPES)


def _joint_state(names, position=None, velocity=None):
    state = AxisState(5, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (10.0, 20.0, 30.0, 40.0, 50.0, 60.0))
    message = conversions.axes_to_message(state, TYPES)
    message.name = names
    message.position = np.arange(len(names), dtype=float) if position is None else position
    message.velocity = np.arange(len(names), dtype=float) if velocity is None else velocity
    return message


@given(st.permutations([*AXES, "gripper"]))
@settings(deadline=None, max_examples=30)
def test_axes_are_found_by_name_and_other_joints_ignored(names):
    state = conversions.axes_from_message(_joint_state(names))
    assert state.position == tuple(float(names.index(axis)) for axis in AXES)
    assert state.velocity == state.position


@pytest.mark.parametrize(("message", "text"), [
    (_joint_state(["x", "y", "z", "b", "c"]), r"missing: s"),
    (_joint_state([*AXES, "x"]), "each name once"),
    (_joint_state(list(AXES), velocity=np.zeros(0)), "joint velocities is 0 values"),
    (_joint_state(list(AXES), position=np.zeros(7)), "joint positions is 7 values"),
])
def test_joint_states_that_make_no_sense_are_refused(message, text):
    with pytest.raises(ValueError, match=text):
        conversions.axes_from_message(message)


def test_block_whose_samples_do_not_fill_its_channels_is_refused():
    block = SensorBlock(0, "daq", 1, 0, 1e3, (Channel("a", "force", "N"),) * 2, np.zeros((3, 2), dtype=np.float32))
    message = conversions.block_to_message(block, TYPES)
    message.samples = message.samples[:-1]
    with pytest.raises(ValueError, match="multiple of the 2 channels"):
        conversions.block_from_message(message)
    message.channels = []
    with pytest.raises(ValueError, match="at least one channel"):
        conversions.block_from_message(message)


@pytest.mark.parametrize(("enum", "message", "prefix"), [
    (Status, "SensorChannel", "STATUS_"), (PredictedType, "StabilityMargin", "TYPE_"),
    (ChatterKind, "ChatterState", ""), (Reason, "ChatterState", "REASON_"), (SpeedSource, "ChatterState", "SPEED_"),
])
def test_enum_values_equal_the_constants_of_the_message(enum, message, prefix):
    text = own_texts()[f"turnmill_msgs/msg/{message}"]
    constants = {name: int(value) for name, value in re.findall(r"^u?int\d+ ([A-Z_]+)=(\d+)", text, re.MULTILINE)}
    prefixes = ("REASON_", "SPEED_")
    own = {name.removeprefix(prefix): value for name, value in constants.items()
           if (name.startswith(prefix) if prefix else not name.startswith(prefixes))}
    assert own == {member.name: member.value for member in enum.__members__.values()}


def _filled(names, start):
    return {name: float(k + start) for k, name in enumerate(names)}


def test_cutting_loads_keep_every_field():
    text = own_texts()["turnmill_msgs/msg/CuttingLoads"]
    scalars = re.findall(r"^float64 (\w+)", text, re.MULTILINE)
    vectors = re.findall(r"^geometry_msgs/Vector3 (\w+)", text, re.MULTILINE)
    loads = SimpleNamespace(
        in_cut=True, **_filled(scalars, 1), **{name: np.array([k, k + 0.5, -k]) for k, name in enumerate(vectors)})
    back = conversions.loads_from_message(_through_bytes(conversions.loads_to_message(loads, 7, "hash", TYPES)))
    assert back.pop("stamp_ns") == 7
    assert back.keys() == vars(loads).keys()
    assert all(np.array_equal(back[name], value) for name, value in vars(loads).items())


def test_margin_keeps_every_field():
    text = own_texts()["turnmill_msgs/msg/StabilityMargin"]
    scalars = re.findall(r"^float64 (\w+)", text, re.MULTILINE)
    margin = SimpleNamespace(
        predicted_type=PredictedType.FLIP, stable_depths=((0.0, 1e-3), (2e-3, 3e-3)),
        multipliers=np.array([-1.1 + 0j, 0.5 + 0.5j]), **_filled(scalars, 0.5))
    message = _through_bytes(conversions.margin_to_message(margin, 9, "hash", TYPES))
    back = conversions.margin_from_message(message)
    assert back.pop("stamp_ns") == 9
    assert back.keys() == vars(margin).keys()
    assert all(np.array_equal(back[name], value) for name, value in vars(margin).items())
    prior = conversions.prior_from_margin(message)
    assert prior == Prior(9, PredictedType.FLIP, margin.spectral_radius, margin.chatter_frequency, 1.1)


def test_values_of_the_core_have_the_fields_of_their_messages():
    operation = read_operation(shipped_operations()["milling_benchmark_1dof"])
    cut = operation.conditions
    loads = cutting_loads(operation, cut, angles=36)
    margin = Margin(
        tool_speed=500.0, workpiece_speed=0.0, depth=1e-3, depth_limit=5e-4, stable_depths=np.array([[0.0, 5e-4]]),
        depth_searched=2e-3, depth_ratio=2.0, spectral_radius=1.4, multipliers=np.array([1 + 1j, 1 - 1j]),
        predicted_type=PredictedType.HOPF, chatter_frequency=950.0, principal_period=6e-3, delay=6e-3,
        nearest_stable_speed=np.nan, limit_type=PredictedType.HOPF, limit_frequency=940.0)
    lobes = Lobes(**vars(_lobes()))
    for value, make, back in (
        (loads, conversions.loads_to_message, conversions.loads_from_message),
        (margin, conversions.margin_to_message, conversions.margin_from_message),
        (lobes, conversions.lobes_to_message, conversions.lobes_from_message),
    ):
        read = back(_through_bytes(make(value, 11, operation.sha256, TYPES)))
        assert read.pop("stamp_ns") == 11
        for name, found in read.items():
            expected = np.asarray(getattr(value, name), dtype=np.asarray(found).dtype)
            assert np.array_equal(np.reshape(expected, np.shape(found)), found, equal_nan=True), name


def _lobes():
    return SimpleNamespace(
        workpiece_speed=0.6, tool_speeds=np.array([100.0, 200.0, 300.0]), depths=np.array([1e-3, 2e-3]),
        spectral_radius=np.arange(6.0).reshape(2, 3), predicted_type=np.array([[2, 2, 3], [3, 4, 4]], dtype=np.uint8),
        depth_limit=np.array([2e-3, 1.5e-3, 1e-3]))


def test_lobes_are_depth_major():
    message = _through_bytes(conversions.lobes_to_message(_lobes(), 3, "hash", TYPES))
    assert message.spectral_radius[1 * 3 + 2] == _lobes().spectral_radius[1, 2]
    back = conversions.lobes_from_message(message)
    assert all(np.array_equal(back[name], value) for name, value in vars(_lobes()).items())


def test_lobes_of_the_wrong_shape_are_refused():
    lobes = _lobes()
    lobes.spectral_radius = lobes.spectral_radius.T
    with pytest.raises(ValueError, match=r"expected \(2, 3\)"):
        conversions.lobes_to_message(lobes, 3, "hash", TYPES)


def test_operation_survives_and_a_changed_text_is_refused():
    operation = read_operation(shipped_operations()["thesis_table_4_9"])
    message = _through_bytes(conversions.operation_to_message(operation, 1, TYPES))
    assert conversions.operation_from_message(message) == operation
    message.yaml += "\n"
    with pytest.raises(ValueError, match="sha256"):
        conversions.operation_from_message(message)


def test_wrench_names_its_frame():
    message = _through_bytes(conversions.wrench_to_message((1, 2, 3), (4, 5, 6), 8, "tool", TYPES))
    assert (message.header.frame_id, message.wrench.force.y, message.wrench.torque.z) == ("tool", 2.0, 6.0)


def test_schema_holds_comments_and_all_nested_messages():
    text = schema_text("turnmill_msgs/msg/ChatterState")
    assert "# rad/s, mean over the window" in text
    assert re.findall(r"^MSG: (.*)$", text, re.MULTILINE) == [
        "std_msgs/Header", "builtin_interfaces/Time", "turnmill_msgs/StabilityPrior"]


@pytest.fixture(scope="module")
def ros():
    pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
    pytest.importorskip("turnmill_msgs.msg", reason="turnmill_msgs is not installed")
    return ros_types()


def _ros_bytes(message) -> bytes:
    from rclpy.serialization import serialize_message

    return serialize_message(message)


def _no_cut():
    scalars = re.findall(r"^float64 (\w+)", own_texts()["turnmill_msgs/msg/StabilityMargin"], re.MULTILINE)
    return SimpleNamespace(predicted_type=PredictedType.NO_CUT, stable_depths=(), multipliers=(), **_filled(scalars, 1))


def _examples():
    rng = np.random.default_rng(1)
    channels = (Channel("mic", "sound_pressure", "Pa", "door", Status.DEAD), Channel("x", "displacement", "m"))
    block = SensorBlock(10**18 + 1, "daq", 3, 512, 51200.0, channels, rng.normal(size=(64, 2)).astype(np.float32))
    verdict = Verdict(1, 2, 3, "daq", 4, "mic", ChatterKind.HOPF, Reason.ASYNCHRONOUS, "off the harmonics", 899.0,
                      (733.0, 899.0), 165.6, 173.4, SpeedSource.REFINED, 0.8, 0.0, 1.5, 0.9,
                      Prior(1, PredictedType.HOPF, 1.2, 900.0))
    operation = read_operation(shipped_operations()["thesis_table_4_9"])
    return {
        "block": lambda types: conversions.block_to_message(block, types),
        "axes": lambda types: conversions.axes_to_message(AxisState(5, (1.0,) * 6, (2.0,) * 6), types),
        "verdict": lambda types: conversions.verdict_to_message(verdict, "hash", types),
        "no prior": lambda types: conversions.verdict_to_message(replace(verdict, prior=None), "hash", types),
        "no cut": lambda types: conversions.margin_to_message(_no_cut(), 3, "hash", types),
        "lobes": lambda types: conversions.lobes_to_message(_lobes(), 3, "hash", types),
        "operation": lambda types: conversions.operation_to_message(operation, 1, types),
        "wrench": lambda types: conversions.wrench_to_message((1, 2, 3), (4, 5, 6), 8, "tool", types),
        "scalar": lambda types: conversions.scalar_to_message(1.5, types),
        "clock": lambda types: conversions.clock_to_message(12, types),
    }


@pytest.mark.ros
@pytest.mark.parametrize("name", _examples())
def test_ros_and_rosbags_serialize_alike(ros, name):
    make = _examples()[name]
    message = make(TYPES)
    own = bytes(typestore().serialize_cdr(message, message.__msgtype__))
    theirs = _ros_bytes(make(ros))
    # ROS leaves padding as it was in memory, and pads behind empty arrays; so compare what is read back.
    assert len(own) <= len(theirs) <= len(own) + 16
    read = decoder(message.__msgtype__, schema_text(message.__msgtype__)).decode(theirs)
    assert bytes(typestore().serialize_cdr(read, message.__msgtype__)) == own


@pytest.mark.ros
def test_ros_block_is_read_without_copying(ros):
    message = _examples()["block"](ros)
    block = conversions.block_from_message(message)
    assert np.shares_memory(block.samples, np.frombuffer(message.samples, dtype=np.float32))
