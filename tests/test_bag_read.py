"""Reading recordings: order, topics, older schemas, foreign and damaged files."""

from __future__ import annotations

import math
import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as FolderWriter
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from tests.bag_cases import START, block, operation, write
from turnmill_ros.bag import bag_info, check_bag, raw_messages, read_bag
from turnmill_ros.conversions import block_from_message, verdict_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import own_texts, schema_text, typestore

BLOCK_TYPE = "turnmill_msgs/msg/SensorBlock"


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("bag") / "whole.mcap", map(block, range(40)))


def test_blocks_come_back_bit_by_bit(whole):
    blocks = [block_from_message(message) for _, _, message in read_bag(whole, ["sensor_blocks"])]
    assert len(blocks) == 40
    assert all(np.array_equal(read.samples, block(k).samples) for k, read in enumerate(blocks))
    assert [read.first_sample for read in blocks] == [block(k).first_sample for k in range(40)]


def test_topics_are_found_with_and_without_namespace(tmp_path):
    path = write(tmp_path / "cut.mcap", map(block, range(3)), namespace="/hall/mill")
    for name, count in (("sensor_blocks", 3), ("/hall/mill/sensor_blocks", 3), ("/sensor_blocks", 0), ("blocks", 0)):
        assert sum(1 for _ in read_bag(path, [name])) == count
    recorded = write(tmp_path / "again.mcap", map(block, range(3)), namespace="/recorded")
    assert sum(1 for _ in read_bag(recorded, ["sensor_blocks"])) == 0
    assert sum(1 for _ in read_bag(recorded, ["/recorded/sensor_blocks"])) == 3


def test_info_tells_topics_span_and_metadata(whole):
    info = bag_info(whole)
    counts = {topic.name: topic.count for topic in info.topics}
    assert counts == {"/joint_states": 40, "/operation": 1, "/sensor_blocks": 40}
    assert info.message_count == 81
    assert info.start_ns == START
    assert info.metadata["operation"]["sha256"] == operation().sha256


def test_rosbag2_folder_is_read_like_a_file(whole, tmp_path):
    folder = tmp_path / "rosbag"
    with FolderWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for message in raw_messages(whole):
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(message.topic, message.type, typestore=typestore())
            writer.write(connections[message.topic], message.log_time_ns, message.data)
    assert [m.message.first_sample for m in read_bag(folder, ["sensor_blocks"])] == [128 * k for k in range(40)]
    assert bag_info(folder).message_count == 81
    assert check_bag(folder) == []


def test_folders_without_a_recording_are_refused(tmp_path):
    with pytest.raises(InputError, match="no recording in this folder"):
        bag_info(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {relative_file_paths: [gone.mcap]}")
    with pytest.raises(InputError, match=r"gone\.mcap: no such recording"):
        bag_info(tmp_path)
    (tmp_path / "metadata.yaml").write_text("nonsense: [")
    with pytest.raises(InputError, match="not a rosbag2 description"):
        bag_info(tmp_path)


@pytest.mark.parametrize(("content", "text"), [
    (None, "no such recording"),
    (b"", "zero length"),
    (b"RIFF....WAVEfmt ", "not an MCAP recording"),
    (b"SQLite format 3\0" + bytes(100), "rosbag2 SQLite file"),
    (b"\x89MCAP0\r\n", "truncated recording .*turnmill recover"),
    (b"\x89MCAP0\r\n" * 3, "damaged recording"),
])
def test_files_that_are_no_recording_are_refused_in_one_line(tmp_path, content, text):
    path = tmp_path / "odd.mcap"
    if content is not None:
        path.write_bytes(content)
    for read in (bag_info, lambda p: list(read_bag(p)), lambda p: list(raw_messages(p))):
        with pytest.raises(InputError, match=text) as caught:
            read(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
    assert [finding.code for finding in check_bag(path)] == ["unreadable"]


@given(st.data())
@settings(deadline=None, max_examples=60)
def test_truncated_at_any_byte_is_an_input_error(whole, tmp_path_factory, data):
    content = whole.read_bytes()
    path = tmp_path_factory.mktemp("cut") / "cut.mcap"
    path.write_bytes(content[: data.draw(st.integers(0, len(content) - 1))])
    with pytest.raises(InputError):
        list(read_bag(path))
    with pytest.raises(InputError):
        bag_info(path)


@given(st.data())
@settings(deadline=None, max_examples=150)
def test_a_flipped_byte_never_gives_other_messages(whole, tmp_path_factory, data):
    content = bytearray(whole.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.mktemp("flip") / "flip.mcap"
    path.write_bytes(content)
    original = [(m.topic, m.log_time_ns, m.data) for m in raw_messages(whole)]
    try:
        read = [(m.topic, m.log_time_ns, m.data) for m in raw_messages(path)]
    except InputError:
        return
    assert read == original


def _mcap(path: Path, name: str, encoding: str, schema: str, message_encoding: str, *messages: bytes,
          topic: str = "/sensor_blocks") -> Path:
    """An MCAP file of another maker."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="other")
        schema_id = writer.register_schema(name, encoding, schema.encode()) if encoding else 0
        channel = writer.register_channel(topic, message_encoding, schema_id)
        for k, data in enumerate(messages):
            writer.add_message(channel, START + k, data, START + k)
        writer.finish()
    return path


@pytest.mark.parametrize(("encoding", "message_encoding"), [("jsonschema", "json"), ("", "cdr"), ("ros2idl", "cdr")])
def test_other_encodings_are_refused(tmp_path, encoding, message_encoding):
    path = _mcap(tmp_path / "foreign.mcap", BLOCK_TYPE, encoding, "{}", message_encoding, b"{}")
    with pytest.raises(InputError, match=r"/sensor_blocks: messages cannot be read.*expected cdr messages"):
        list(read_bag(path))
    assert list(read_bag(path, ["joint_states"])) == []
    assert "error" in {finding.severity for finding in check_bag(path)}


def test_messages_that_do_not_fit_their_schema_are_refused(tmp_path):
    path = _mcap(tmp_path / "bad.mcap", BLOCK_TYPE, "ros2msg", schema_text(BLOCK_TYPE), "cdr", b"\x00\x01\x00\x00abc")
    with pytest.raises(InputError, match=r"/sensor_blocks: message at 1000000000000 ns cannot be decoded"):
        list(read_bag(path))
    unparsable = _mcap(tmp_path / "worse.mcap", BLOCK_TYPE, "ros2msg", "float64[ what", "cdr", b"\x00\x01\x00\x00")
    with pytest.raises(InputError, match="schema cannot be parsed"):
        list(read_bag(unparsable))
    assert "other_schema" in {finding.code for finding in check_bag(unparsable)}


def _older(name: str, change) -> tuple[str, Typestore]:
    """Embedded schema and type store of a changed version of a message of ours."""
    own = own_texts()[name]
    text = schema_text(name).replace(own, change(own))
    store = Typestore()
    store.register(get_types_from_msg(text, name))
    return text, store


def _fill(store: Typestore, name: str, /, **values):
    """Message of `store` with every field set: to `values`, or to 0, "" and so on."""
    fields = {}
    for field, (node, detail) in store.fielddefs[name][1]:
        if field in values:
            fields[field] = values[field]
        elif node == 2:
            fields[field] = _fill(store, detail)
        elif node == 1:
            fields[field] = "" if detail[0] == "string" else False if detail[0] == "bool" else 0
        else:
            inner = detail[0][1]
            fields[field] = [] if detail[0][0] == 2 or inner[0] == "string" else np.zeros(0, dtype=inner[0])
    return store.types[name](**fields)


def test_older_schema_reads_and_missing_fields_get_defaults(tmp_path):
    """A verdict of a version without four of today's fields, in another order, with one that is gone."""
    name = "turnmill_msgs/msg/ChatterState"

    def older(text: str) -> str:
        gone = ("float64 confidence", "float64[] chatter_family", "uint64 last_sample", "string operation_hash")
        kept = [line for line in text.splitlines() if not line.startswith(gone)]
        kept = [line for line in kept if not line.startswith("uint8 state")] + ["uint16 state", "float32 temperature"]
        return "\n".join(kept) + "\n"

    text, store = _older(name, older)
    message = _fill(store, name, state=4, reason_code=11, chatter_frequency=899.0, device="daq", temperature=21.0)
    data = bytes(store.serialize_cdr(message, name))
    path = _mcap(tmp_path / "old.mcap", name, "ros2msg", text, "cdr", data, topic="/chatter_state")
    [(_, _, read)] = read_bag(path)
    assert (read.state, read.reason_code, read.chatter_frequency, read.device) == (4, 11, 899.0, "daq")
    assert math.isnan(read.confidence)
    assert (read.last_sample, read.operation_hash, len(read.chatter_family)) == (0, "", 0)
    assert not hasattr(read, "temperature")
    assert verdict_from_message(read).state.name == "HOPF"
    [raw] = raw_messages(path)
    assert typestore().deserialize_cdr(raw.data, name).device == "daq"
    note = next(finding for finding in check_bag(path) if finding.code == "other_schema")
    assert note.severity == "note"
    assert "lacks chatter_family, confidence, last_sample, operation_hash" in note.text
    assert "temperature" in note.text


def test_nested_fields_that_are_missing_get_defaults(tmp_path):
    """A sensor block whose channels had neither location nor status."""
    text = schema_text(BLOCK_TYPE)
    lines = [line for line in text.splitlines() if not line.startswith(("string location", "uint8 status"))]
    store = Typestore()
    store.register(get_types_from_msg("\n".join(lines) + "\n", BLOCK_TYPE))
    channel = _fill(store, "turnmill_msgs/msg/SensorChannel", name="mic", quantity="sound_pressure", unit="Pa")
    message = _fill(store, BLOCK_TYPE, device="daq", sample_rate=1e3, channels=[channel, channel],
                    samples=np.arange(6, dtype=np.float32))
    data = bytes(store.serialize_cdr(message, BLOCK_TYPE))
    path = _mcap(tmp_path / "old.mcap", BLOCK_TYPE, "ros2msg", "\n".join(lines) + "\n", "cdr", data)
    [(_, _, read)] = read_bag(path)
    converted = block_from_message(read)
    assert converted.channels[1].location == ""
    assert converted.channels[1].status == 0
    assert converted.samples[2, 1] == 5.0


@pytest.mark.parametrize("line", ["string state", "uint8[] state", "std_msgs/Header state"])
def test_a_field_of_another_kind_is_refused(tmp_path, line):
    name = "turnmill_msgs/msg/ChatterState"
    text, store = _older(name, lambda own: re.sub(r"^uint8 state\b", line, own, flags=re.M))
    data = bytes(store.serialize_cdr(_fill(store, name), name))
    path = _mcap(tmp_path / "odd.mcap", name, "ros2msg", text, "cdr", data, topic="/chatter_state")
    with pytest.raises(InputError, match="state: a field of the embedded schema changed its kind"):
        list(read_bag(path))


def test_messages_of_unknown_types_are_read_by_their_own_schema(tmp_path):
    path = _mcap(tmp_path / "other.mcap", "shop_msgs/msg/Door", "ros2msg", "bool open\nuint32 count\n", "cdr",
                 b"\x00\x01\x00\x00\x01\x00\x00\x00" + struct.pack("<I", 7), topic="/door")
    [(topic, log_time_ns, message)] = read_bag(path)
    assert (topic, log_time_ns, message.open, message.count) == ("/door", START, True, 7)
