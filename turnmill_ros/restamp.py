"""Shifts serialized messages in time, for a recording that is played again and again."""

from __future__ import annotations

import struct

HEADER = 4
"""Length of the CDR encapsulation before the message."""


def shifted(data: bytes, delta_ns: int, streams: int = 0) -> bytes:
    """A little-endian CDR message that begins with std_msgs/Header, its stamp later by `delta_ns`.

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
        at = _after_string(changed, _after_string(changed, HEADER + 8))
        (stream,) = struct.unpack_from("<I", changed, at)
        struct.pack_into("<I", changed, at, (stream + streams) % 2**32)
    return bytes(changed)


def _after_string(data: bytearray, at: int) -> int:
    """Offset of the next 4-byte field after the string that begins at `at`."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length - HEADER
    return end + (-end % 4) + HEADER
