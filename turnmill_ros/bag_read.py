"""Reading a recording by the schema that it carries."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import yaml
import zstandard
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Schema
from mcap.stream_reader import CRCValidationError
from rosbags.serde import SerdeError
from rosbags.typesys.msg import normalize_msgtype

from turnmill_ros.complete_file import MAGIC
from turnmill_ros.decoding import Decoder, decoder
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import typestore
from turnmill_ros.topics import RECORDED

_FOOTER = struct.Struct("<QQI")
DAMAGE = (
    McapError, CRCValidationError, zstandard.ZstdError, struct.error, ValueError, RuntimeError, KeyError, IndexError,
    OverflowError, MemoryError, TypeError, EOFError,
)
"""What the MCAP reader and the decompressors raise on a damaged file."""


class RawMessage(NamedTuple):
    """A serialized message, in the present schema where the type is known. Times in ns."""

    topic: str
    type: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes


class BagMessage(NamedTuple):
    """A decoded message (rosbags' classes) and the time at which it was recorded [ns]."""

    topic: str
    log_time_ns: int
    message: Any


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a recording; schema is its embedded text, schema_encoding normally "ros2msg"."""

    name: str
    type: str
    count: int
    encoding: str
    schema_encoding: str
    schema: str


@dataclass(frozen=True)
class BagInfo:
    """What a recording holds; times in ns, None without messages; metadata records by name."""

    path: Path
    start_ns: int | None
    end_ns: int | None
    topics: tuple[TopicInfo, ...]
    metadata: dict[str, dict[str, str]]

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.count for topic in self.topics)


def bag_files(path: str | Path) -> list[Path]:
    """The .mcap files of a recording: the file itself, or those of a rosbag2 folder in their order."""
    path = Path(path)
    if not path.exists():
        raise InputError("no such recording", file=path)
    if not path.is_dir():
        return [path]
    try:
        listed = yaml.safe_load((path / "metadata.yaml").read_text("utf-8"))["rosbag2_bagfile_information"]
        files = [path / Path(name).name for name in listed["relative_file_paths"]]
    except FileNotFoundError:
        files = sorted(path.glob("*.mcap"))
    except (yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise InputError("not a rosbag2 description", file=path / "metadata.yaml") from error
    if not files:
        raise InputError("no recording in this folder", file=path, expected="an .mcap file or a rosbag2 folder")
    for file in files:
        if not file.exists():
            raise InputError("no such recording", file=file)
    return files


@contextmanager
def open_mcap(path: Path) -> Iterator[McapReader]:
    """Reader of one complete MCAP file; every damage becomes an InputError that says what to do."""
    try:
        stream = path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror}", file=path) from error
    with stream:
        _check_ends(stream, path)
        try:
            _check_summary(stream)
            yield make_reader(stream, validate_crcs=True)
        except (OSError, *DAMAGE) as error:
            raise InputError("damaged recording", file=path, hint=f"turnmill recover {path}") from error


def _check_ends(stream: IO[bytes], path: Path) -> None:
    head = stream.read(len(MAGIC))
    size = stream.seek(0, 2)
    if size == 0:
        raise InputError("the recording is empty (zero length)", file=path)
    if head != MAGIC:
        other = " (it is a rosbag2 SQLite file)" if head.startswith(b"SQLite") else ""
        raise InputError(f"not an MCAP recording{other}", file=path)
    stream.seek(max(size - len(MAGIC), 0))
    if size < 2 * len(MAGIC) or stream.read(len(MAGIC)) != MAGIC:
        raise InputError("truncated recording", file=path, hint=f"turnmill recover {path}")
    stream.seek(0)


def _check_summary(stream: IO[bytes]) -> None:
    """Raise ValueError where the summary section fails its checksum, which the MCAP reader does not look at."""
    end = stream.seek(-len(MAGIC) - 4, 2)
    stream.seek(-len(MAGIC) - _FOOTER.size, 2)
    start, _, expected = _FOOTER.unpack(stream.read(_FOOTER.size))
    if start and expected:
        stream.seek(start)
        found = 0
        while stream.tell() < end:
            found = zlib.crc32(stream.read(min(1 << 20, end - stream.tell())), found)
        if found != expected:
            raise ValueError("the summary fails its checksum")
    stream.seek(0)


def _wanted(topic: str, topics: frozenset[str] | None) -> bool:
    """True for a full name in `topics`, and for any namespace of a relative one, except under recorded/."""
    if topics is None or topic in topics:
        return True
    parts = topic.strip("/").split("/")
    return RECORDED not in parts and any("/".join(parts[k:]) in topics for k in range(len(parts)))


def bag_info(path: str | Path) -> BagInfo:
    """Topics, counts, time span and metadata of a recording.

    Raises InputError for a file that is missing, empty, no MCAP, truncated or damaged.
    """
    topics: dict[tuple[str, str, str], TopicInfo] = {}
    spans: list[tuple[int, int]] = []
    metadata: dict[str, dict[str, str]] = {}
    for file in bag_files(path):
        with open_mcap(file) as reader:
            for record in reader.iter_metadata():
                metadata[record.name] = dict(record.metadata)
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None and summary.statistics.message_count:
                spans.append((summary.statistics.message_start_time, summary.statistics.message_end_time))
                counts = [(summary.schemas.get(channel.schema_id), channel,
                           summary.statistics.channel_message_counts.get(channel.id, 0))
                          for channel in summary.channels.values()]
            else:
                seen: dict[int, list[Any]] = {}
                for schema, channel, message in reader.iter_messages(log_time_order=False):
                    seen.setdefault(channel.id, [schema, channel, 0])[2] += 1
                    spans.append((message.log_time, message.log_time))
                    spans = [(min(s[0] for s in spans), max(s[1] for s in spans))]
                counts = [(schema, channel, count) for schema, channel, count in seen.values()]
        for schema, channel, count in counts:
            name = normalize_msgtype(schema.name) if schema else ""
            key = (channel.topic, name, channel.message_encoding)
            known = topics.get(key)
            topics[key] = TopicInfo(
                channel.topic, name, count + (known.count if known else 0), channel.message_encoding,
                schema.encoding if schema else "", schema.data.decode("utf-8", "replace") if schema else "")
    return BagInfo(
        Path(path), min((s[0] for s in spans), default=None), max((s[1] for s in spans), default=None),
        tuple(sorted(topics.values(), key=lambda topic: topic.name)), metadata)


def read_bag(path: str | Path, topics: Iterable[str] | None = None) -> Iterator[BagMessage]:
    """Decoded messages in order of log time.

    topics: full names, or relative ones, which stand for that topic in every namespace (not under recorded/);
    None reads all. Messages are decoded by the
    schema in the file and handed out in the present one, field by field; a field that the file does not know gets
    NaN (floating point), 0, False, "" or an empty array.

    Raises InputError where the file or a message of a wanted topic cannot be read.
    """
    for file, schema, raw in _messages(path, topics):
        yield BagMessage(raw.topic, raw.log_time_ns, _decode(file, schema, raw))


def raw_messages(path: str | Path, topics: Iterable[str] | None = None) -> Iterator[RawMessage]:
    """Serialized messages in order of log time, ready to publish or to write.

    Bytes pass untouched unless the file holds an older schema of a type known here: then they are decoded
    and serialized anew. Raises as `read_bag`.
    """
    for file, schema, raw in _messages(path, topics):
        if schema_decoder(schema).upgrades:
            decoded = _decode(file, schema, raw)
            yield raw._replace(data=bytes(typestore().serialize_cdr(decoded, raw.type)))
        else:
            yield raw


def _messages(path: str | Path, topics: Iterable[str] | None) -> Iterator[tuple[Path, Schema, RawMessage]]:
    wanted = None if topics is None else frozenset(topics)
    for file in bag_files(path):
        with open_mcap(file) as reader:
            summary = reader.get_summary()
            names = None if summary is None or wanted is None else [
                channel.topic for channel in summary.channels.values() if _wanted(channel.topic, wanted)]
            for schema, channel, message in reader.iter_messages(names) if names != [] else ():
                if not _wanted(channel.topic, wanted):
                    continue
                if schema is None or schema.encoding != "ros2msg" or channel.message_encoding != "cdr":
                    raise InputError(
                        "messages cannot be read", file=file, key=channel.topic,
                        value=f"{channel.message_encoding}/{schema.encoding if schema else 'no schema'}",
                        expected="cdr messages with a ros2msg schema")
                yield file, schema, RawMessage(
                    channel.topic, normalize_msgtype(schema.name), message.log_time, message.publish_time, message.data)


def _decode(file: Path, schema: Schema, raw: RawMessage) -> Any:
    try:
        return schema_decoder(schema).decode(raw.data)
    except (SerdeError, *DAMAGE) as error:
        raise InputError(f"message at {raw.log_time_ns} ns cannot be decoded as {raw.type}", file=file,
                         key=raw.topic) from error


def schema_decoder(schema: Schema) -> Decoder:
    """Decoder for a schema record."""
    return decoder(normalize_msgtype(schema.name), schema.data.decode("utf-8", "replace"))
