"""Reading and changing serialized messages, held against decoding and encoding them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bag_cases import TYPES, axes, block
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_ros.conversions import axes_to_message, block_from_message, block_to_message
from turnmill_ros.interfaces import typestore
from turnmill_ros.serialized import extent, measures, shifted, stamp_ns

TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
BLOCK = "turnmill_msgs/msg/SensorBlock"


@pytest.mark.parametrize("device", ["", "d", "daq", "data acquisition"])
@pytest.mark.parametrize("delta_ns", [0, 1, 1_234_567_890_123, -999_999_999])
def test_a_block_is_later_and_from_a_new_stream(device: str, delta_ns: int) -> None:
    message = block_to_message(block(3), TYPES)
    message.device = device
    data = bytes(typestore().serialize_cdr(message, BLOCK))
    found = block_from_message(typestore().deserialize_cdr(shifted(data, delta_ns, 4), BLOCK))
    assert found.stamp_ns == block(3).stamp_ns + delta_ns
    assert (found.stream_id, found.device, found.first_sample) == (5, device, block(3).first_sample)
    assert (found.samples == block(3).samples).all()


def test_only_the_stamp_changes_without_streams() -> None:
    data = bytes(typestore().serialize_cdr(axes_to_message(axes(5), TYPES), "sensor_msgs/msg/JointState"))
    assert shifted(data, 0) == data
    assert shifted(shifted(data, 77), -77) == data


def test_stamp_and_quantities_are_read_without_decoding() -> None:
    message = axes_to_message(axes(1_234_567_890_123), TYPES)
    data = bytes(typestore().serialize_cdr(message, "sensor_msgs/msg/JointState"))
    assert stamp_ns(data) == 1_234_567_890_123
    found = bytes(typestore().serialize_cdr(block_to_message(block(0), TYPES), BLOCK))
    assert measures(found, ("force", "displacement"))
    assert not measures(found, ("force", "power"))
    with pytest.raises(ValueError, match="header"):
        stamp_ns(b"short")


def test_big_endian_data_is_refused() -> None:
    data = bytes(typestore().serialize_cdr(block_to_message(block(0), TYPES), BLOCK, little_endian=False))
    with pytest.raises(ValueError, match="little-endian"):
        shifted(data, 1)


@given(TEXT, st.lists(st.tuples(TEXT, TEXT, TEXT, TEXT), min_size=1, max_size=5), st.integers(0, 2**32 - 1),
       st.integers(0, 2**63), st.integers(0, 7))
def test_the_extent_of_a_block(
    device: str, channels: list[tuple[str, str, str, str]], stream: int, first: int, count: int,
) -> None:
    made = SensorBlock(5, device, stream, first, 6400.0, tuple(Channel(*texts) for texts in channels),
                       np.zeros((count, len(channels)), np.float32))
    data = bytes(typestore().serialize_cdr(block_to_message(made, TYPES), BLOCK))
    assert extent(data) == (device, stream, first, count)


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 60, b"\0\1\0\0" + bytes(60)])
def test_what_is_no_block_has_no_extent(data: bytes) -> None:
    with pytest.raises(ValueError, match="not a serialized sensor block"):
        extent(data)
