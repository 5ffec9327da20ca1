"""Shifting serialized messages, held against decoding and encoding them."""

from __future__ import annotations

import pytest

from tests.bag_cases import TYPES, axes, block
from turnmill_ros.conversions import axes_to_message, block_from_message, block_to_message
from turnmill_ros.interfaces import typestore
from turnmill_ros.restamp import shifted

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


def test_big_endian_data_is_refused() -> None:
    data = bytes(typestore().serialize_cdr(block_to_message(block(0), TYPES), BLOCK, little_endian=False))
    with pytest.raises(ValueError, match="little-endian"):
        shifted(data, 1)
