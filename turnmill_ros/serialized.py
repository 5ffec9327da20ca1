"""What can be read from or changed in a serialized message without decoding it (little-endian CDR)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

HEADER = 4
"""Length of the CDR encapsulation before the message; alignment counts from its end."""

STAMP = 8
"""Length of a time."""


class Extent(NamedTuple):
    """Which samples of which stream a block holds; samples counts those of one channel."""

    device: str
    stream_id: int
    first_sample: int
    samples: int


def extent(data: bytes) -> Extent:
    """Extent of a serialized SensorBlock, found by walking over its strings; the samples are not touched.

    Raises ValueError for anything else.
    """
    try:
        device_at = _aligned(_string_end(data, HEADER + STAMP), 4)
        stream_at = _aligned(_string_end(data, device_at), 4)
        device = data[device_at + 4: _string_end(data, device_at) - 1].decode()
        (stream_id,) = struct.unpack_from("<I", data, stream_at)
        at = _aligned(stream_at + 4, 8)
        first_sample, _, channels = struct.unpack_from("<QdI", data, at)
        at += 20
        for _ in range(channels):
            for _ in range(4):  # name, quantity, unit, location
                at = _string_end(data, _aligned(at, 4))
            at += 1  # status
        (values,) = struct.unpack_from("<I", data, _aligned(at, 4))
        return Extent(device, stream_id, first_sample, values // channels)
    except (struct.error, UnicodeDecodeError, ZeroDivisionError) as error:
        raise ValueError("not a serialized sensor block") from error


def stamp_ns(data: bytes) -> int:
    """Time [ns] of a message that begins with std_msgs/Header. Raises ValueError for anything too short."""
    try:
        sec, nanosec = struct.unpack_from("<iI", data, HEADER)
    except struct.error as error:
        raise ValueError("not a serialized message with a header") from error
    return int(sec) * 1_000_000_000 + int(nanosec)


def measures(data: bytes, quantities: Iterable[str]) -> bool:
    """False where a serialized SensorBlock has no channel of these quantities; True may be by chance."""
    return any(f"{quantity}\0".encode() in data for quantity in quantities)


def shifted(data: bytes, delta_ns: int, streams: int = 0) -> bytes:
    """A message that begins with std_msgs/Header, its stamp later by `delta_ns`.

    streams: added to the stream_id, for messages whose fields after the header are string device, uint32
    stream_id (SensorBlock, ChatterState). Raises ValueError for big-endian data.
    """
    if data[1] != 1:
        raise ValueError("cannot shift a message that is not little-endian CDR")
    changed = bytearray(data)
    sec, nanosec = struct.unpack_from("<iI", changed, HEADER)
    sec, nanosec = divmod(sec * 1_000_000_000 + nanosec + delta_ns, 1_000_000_000)
    struct.pack_into("<iI", changed, HEADER, sec, nanosec)
    if streams:
        device_at = _aligned(_string_end(changed, HEADER + STAMP), 4)
        stream_at = _aligned(_string_end(changed, device_at), 4)
        (stream,) = struct.unpack_from("<I", changed, stream_at)
        struct.pack_into("<I", changed, stream_at, (stream + streams) % 2**32)
    return bytes(changed)


def _string_end(data: bytes | bytearray, at: int) -> int:
    """Offset after the string at the aligned offset `at`."""
    (length,) = struct.unpack_from("<I", data, at)
    return int(at + 4 + length)


def _aligned(at: int, size: int) -> int:
    """The next offset that a field of `size` bytes may have."""
    return at + (HEADER - at) % size
