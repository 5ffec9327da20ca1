"""Salvage of a recording that was cut short or damaged."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from turnmill_ros.bag_read import DAMAGE
from turnmill_ros.bag_write import BagWriter
from turnmill_ros.complete_file import MAGIC
from turnmill_ros.errors import InputError

_HEAD = struct.Struct("<BQ")
_READ = {Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read, Opcode.METADATA: Metadata.read,
         Opcode.ATTACHMENT: Attachment.read}


@dataclass(frozen=True)
class Recovery:
    """What a salvage saved and lost.

    path: the new file; messages: saved, of all topics; start_ns, end_ns: their span (None without any);
    complete: nothing was lost; damaged_chunks: chunks inside the file that could not be read;
    lost_bytes: bytes from the place where the file could no longer be followed to its end; lost_spans_ns: log times
    (first, last) of what was lost; last is None where the file breaks off, since nobody knows how much followed.
    """

    path: Path
    messages: int
    start_ns: int | None
    end_ns: int | None
    complete: bool
    damaged_chunks: int
    lost_bytes: int
    lost_spans_ns: tuple[tuple[int, int | None], ...]

    @property
    def duration(self) -> float:
        """Time from the first to the last saved message [s]."""
        return 0.0 if self.start_ns is None or self.end_ns is None else (self.end_ns - self.start_ns) * 1e-9

    @property
    def lost(self) -> str:
        """What was lost, in words; times in seconds from the first saved message."""
        start = self.start_ns or 0
        spans = [
            f"from {(first - start) * 1e-9:.3f} s " + ("on" if last is None else f"to {(last - start) * 1e-9:.3f} s")
            for first, last in self.lost_spans_ns]
        parts = [f"messages {', '.join(spans)}"] if spans else []
        if self.lost_bytes:
            parts.append(f"{self.lost_bytes} bytes at the end")
        return "; ".join(parts) or "nothing"


def recover(path: str | Path, out: str | Path, *, overwrite: bool = False) -> Recovery:
    """Stream the records of a truncated or damaged recording into a new file `out`, schemas as they are.

    A chunk that fails its checksum or cannot be decompressed is left out; reading ends where the file can
    no longer be followed. Raises InputError where `path` is no MCAP file or holds no message, or `out` exists.
    """
    path, out = Path(path), Path(out)
    try:
        stream = path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror}", file=path) from error
    with stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise InputError("not an MCAP recording; nothing can be recovered", file=path)
        size = stream.seek(0, 2)
        with BagWriter(out, overwrite=overwrite, versions={}) as writer:
            salvage = _Salvage(writer)
            rest = _copy(stream, size, salvage)
            if salvage.messages == 0:
                raise InputError("no message could be recovered", file=path)
            if rest is not None:
                first = rest.first if rest.first is not None else salvage.end
                salvage.lost.append((first or 0, None))
            lost_bytes = rest.lost_bytes if rest is not None else 0
            writer.add_metadata("recovery", {
                "source": path.name, "messages": str(salvage.messages), "damaged_chunks": str(salvage.damaged),
                "lost_bytes": str(lost_bytes), "reached_end": str(rest is None).lower()})
    return Recovery(
        out, salvage.messages, salvage.start, salvage.end, rest is None and not salvage.damaged, salvage.damaged,
        lost_bytes, tuple(salvage.lost))


@dataclass(frozen=True)
class _Rest:
    """What could not be followed: bytes, and its first log time [ns] where a chunk still tells it."""

    lost_bytes: int = 0
    first: int | None = None


class _Salvage:
    """Copies records into a writer."""

    def __init__(self, writer: BagWriter) -> None:
        self.writer = writer
        self.messages = self.damaged = 0
        self.start: int | None = None
        self.end: int | None = None
        self.lost: list[tuple[int, int | None]] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, tuple[str, str]] = {}

    def body(self, opcode: int, body: bytes) -> None:
        """Copy one record of the file; a damaged one is counted and left out."""
        data = ReadDataStream(BytesIO(body))
        try:
            if opcode == Opcode.CHUNK:
                records = self._opened(Chunk.read(data))
            elif opcode == Opcode.MESSAGE:
                records = [Message.read(data, len(body))]
            elif opcode in _READ:
                records = [_READ[opcode](data)]
            else:
                return
        except DAMAGE:
            self.damaged += 1
            return
        for record in records:
            self._record(record)

    def _opened(self, chunk: Chunk) -> list[McapRecord]:
        try:
            return breakup_chunk(chunk, validate_crc=True)
        except DAMAGE:
            self.damaged += 1
            self.lost.append((chunk.message_start_time, chunk.message_end_time))
            return []

    def _record(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channel(record)
        elif isinstance(record, Message) and record.channel_id in self._channels:
            topic, name = self._channels[record.channel_id]
            self.writer.write_raw(topic, name, record.data, record.log_time, record.publish_time, record.sequence)
            self.messages += 1
            self.start = record.log_time if self.start is None else min(self.start, record.log_time)
            self.end = record.log_time if self.end is None else max(self.end, record.log_time)
        elif isinstance(record, Metadata):
            self.writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            self.writer.add_attachment(record)

    def _channel(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        name = schema.name if schema else ""
        self.writer.add_channel(
            channel.topic, name, (schema.encoding, schema.data) if schema else ("", b""), channel.message_encoding,
            channel.metadata)
        self._channels[channel.id] = (channel.topic, name)


def _frames(stream: IO[bytes], size: int) -> Iterator[tuple[int, int, bytes]]:
    """Whole records as (position, opcode, body), as far as lengths can be followed."""
    position = stream.seek(len(MAGIC))
    while len(head := stream.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        if position + _HEAD.size + length > size:
            return
        yield position, opcode, stream.read(length)
        position += _HEAD.size + length


def _copy(stream: IO[bytes], size: int, salvage: _Salvage) -> _Rest | None:
    """Copy all records of the data section; what could not be followed, or None where the section is whole."""
    end = len(MAGIC)
    for position, opcode, body in _frames(stream, size):
        end = position + _HEAD.size + len(body)
        if opcode == Opcode.DATA_END:
            return None
        salvage.body(opcode, body)
    stream.seek(end)
    head = stream.read(_HEAD.size + 8)
    if len(head) == _HEAD.size + 8 and head[0] == Opcode.CHUNK:
        return _Rest(size - end, int.from_bytes(head[_HEAD.size:], "little"))
    return _Rest(size - end)
