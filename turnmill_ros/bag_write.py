"""Writing a recording: MCAP, profile ros2, complete after every chunk."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

from turnmill_core.operation import Operation
from turnmill_ros.complete_file import CompleteFile
from turnmill_ros.errors import InputError, RecordingError
from turnmill_ros.interfaces import schema_text, type_hash, typestore
from turnmill_ros.topics import find
from turnmill_ros.versions import software_versions

CHUNK_BYTES = 64 * 1024
CHUNK_NS = 500_000_000
_COMPRESSION = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}


class BagWriter:
    """Writes one recording, PATH.part until it is closed, then PATH.

    A chunk closes after 64 kB or 0.5 s of log time; whoever records live calls `flush` from a timer as well,
    so that a quiet topic reaches the disk. After every chunk the file on disk is complete. At close an index is
    added, and the file gets its name in one step.

    As a context manager: leaving normally, or after a RecordingError, closes; any other exception removes the
    unfinished file.

    path: ends in .mcap. overwrite: replace an existing file. compression: "zstd", "lz4" or "none".
    operation: written as metadata record "operation" (name, yaml, sha256). metadata: further records, by
    name. versions: the record "versions", `software_versions()` if None,
    no record if empty.

    Raises InputError where the file exists or cannot be made, RecordingError when the disk is full.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        compression: str = "zstd",
        operation: Operation | None = None,
        metadata: Mapping[str, Mapping[str, str]] | None = None,
        versions: Mapping[str, str] | None = None,
    ) -> None:
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        self.message_count = 0
        self.last_log_time_ns: int | None = None
        self._overwrite = overwrite
        self._ids: dict[tuple[str, str], int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._chunk_start: int | None = None
        self._unsaved = 0
        self._failure: RecordingError | None = None
        self._closed = False
        if compression not in _COMPRESSION:
            raise InputError("unknown compression", value=compression, expected=" or ".join(_COMPRESSION))
        if self.path.suffix != ".mcap":
            raise InputError("unknown kind of recording", file=self.path, expected="a name that ends in .mcap")
        if self.path.exists() and not overwrite:
            raise InputError("output exists", file=self.path, hint="choose another name or allow it to be replaced")
        try:
            self._file = CompleteFile(self.part)
        except FileExistsError as error:
            raise InputError("an unfinished recording is in the way", file=self.part,
                             hint=f"turnmill recover {self.part}, or remove it") from error
        except OSError as error:
            raise InputError(f"cannot write: {error.strerror}", file=self.path) from error
        self._writer = Writer(
            self._file, chunk_size=CHUNK_BYTES, compression=_COMPRESSION[compression])  # type: ignore[arg-type]
        try:
            self._writer.start(profile="ros2", library="turnmill")
            versions = software_versions() if versions is None else versions
            if versions:
                self.add_metadata("versions", versions)
            if operation is not None:
                self.add_metadata("operation", operation_metadata(operation))
            for name, data in (metadata or {}).items():
                self.add_metadata(name, data)
        except OSError as error:
            raise self._fail(error) from error

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a metadata record."""
        self._ready()
        try:
            self._writer.add_metadata(name, dict(data))
        except OSError as error:
            raise self._fail(error) from error

    def add_attachment(self, attachment: Attachment) -> None:
        """Write an attachment of another MCAP file."""
        self._ready()
        try:
            self._writer.add_attachment(attachment.create_time, attachment.log_time, attachment.name,
                                        attachment.media_type, attachment.data)
        except OSError as error:
            raise self._fail(error) from error

    def add_channel(
        self, topic: str, type_name: str, schema: tuple[str, bytes] | None = None, encoding: str = "cdr",
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Declare a topic before its first message; needed only where its schema is not the present one.

        schema: (schema encoding, text) as embedded in another recording.
        """
        if (topic, type_name) in self._ids:
            return
        if schema is None:
            try:
                schema = ("ros2msg", schema_text(type_name).encode())
            except KeyError as error:
                raise InputError("message type is unknown", file=self.path, key=topic, value=type_name) from error
            metadata = _channel_metadata(topic, type_name)
        key = (type_name, *schema)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(*key)
        self._ids[topic, type_name] = self._writer.register_channel(
            topic, encoding, self._schemas[key], dict(metadata or {}))

    def write_raw(
        self, topic: str, type_name: str, data: bytes | memoryview, log_time_ns: int,
        publish_time_ns: int | None = None, sequence: int = 0,
    ) -> None:
        """Add a serialized message (CDR). topic: absolute name. log_time_ns >= 0."""
        self._ready()
        if (topic, type_name) not in self._ids:
            self.add_channel(topic, type_name)
        if log_time_ns < 0:
            raise InputError("log time", file=self.path, key=topic, value=log_time_ns, expected="a time >= 0 ns")
        try:
            if self._chunk_start is not None and abs(log_time_ns - self._chunk_start) > CHUNK_NS:
                self.flush()
            if self._chunk_start is None:
                self._chunk_start = log_time_ns
            before = self._file.tell()
            self._unsaved += 1
            self._writer.add_message(
                self._ids[topic, type_name], log_time_ns, bytes(data),
                log_time_ns if publish_time_ns is None else publish_time_ns, sequence)
            if self._file.tell() != before:
                self._saved()
        except OSError as error:
            raise self._fail(error) from error
        self.last_log_time_ns = max(log_time_ns, self.last_log_time_ns or 0)

    def write(self, topic: str, message: Any, log_time_ns: int, publish_time_ns: int | None = None) -> None:
        """Add a message of rosbags' classes (:func:`turnmill_ros.interfaces.rosbags_types`)."""
        name = message.__msgtype__
        self.write_raw(topic, name, typestore().serialize_cdr(message, name), log_time_ns, publish_time_ns)

    def flush(self) -> None:
        """Close the open chunk: all messages so far are in the file."""
        self._ready()
        try:
            self._writer.flush()
        except OSError as error:
            raise self._fail(error) from error
        self._saved()

    def close(self) -> Path:
        """Finish the file and give it its name; returns it. A second call does nothing.

        Raises RecordingError where the index no longer fits on the disk (the file is complete without it) or
        where a file of that name came into being meanwhile.
        """
        if self._closed:
            return self.path
        known = self._failure
        if known is None:
            try:
                self.flush()
                self._file.hold()
                self._writer.finish()
                self._file.release()
            except RecordingError:
                pass  # kept in self._failure; the file gets its name first
            except OSError as error:
                self._fail(error)
        self._closed = True
        self._file.close()
        if self.path.exists() and not self._overwrite:
            raise RecordingError("another file has taken the output's name; the recording is here", path=self.part,
                                 messages=self.message_count)
        os.replace(self.part, self.path)
        if self._failure is not None and self._failure is not known:
            raise self._failure
        return self.path

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        if not self._closed:
            self._closed = True
            self._file.close()
            self.part.unlink(missing_ok=True)

    def _ready(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closed:
            raise ValueError(f"{self.path} is closed")

    def _saved(self) -> None:
        self.message_count += self._unsaved
        self._unsaved = 0
        self._chunk_start = None

    def _fail(self, error: OSError) -> RecordingError:
        full = error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
        reason = "the disk is full" if full else f"cannot write: {error.strerror}"
        self._failure = RecordingError(
            f"{reason}; the {self.message_count} messages up to here are saved, {self._unsaved} are lost",
            path=self.path, messages=self.message_count)
        return self._failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None,
    ) -> None:
        if kind is None or isinstance(error, RecordingError):
            self.close()
        else:
            self.discard()


def operation_metadata(operation: Operation) -> dict[str, str]:
    """Content of the metadata record "operation"."""
    return {"name": operation.name, "sha256": operation.sha256, "yaml": operation.text}


def _channel_metadata(topic: str, type_name: str) -> dict[str, str]:
    """Type hash and quality of service as rosbag2 keeps them with a channel."""
    entry = find(topic)
    metadata = {"topic_type_hash": type_hash(type_name)}
    if entry is not None:
        zero = "{sec: 0, nsec: 0}"
        metadata["offered_qos_profiles"] = (
            f"- history: keep_last\n  depth: {entry.depth}\n  reliability: {entry.reliability}\n"
            f"  durability: {entry.durability}\n  deadline: {zero}\n  lifespan: {zero}\n  liveliness: automatic\n"
            f"  liveliness_lease_duration: {zero}\n  avoid_ros_namespace_conventions: false\n")
    return metadata
