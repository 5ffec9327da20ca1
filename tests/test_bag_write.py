"""Writing recordings: what stands in the file, who opens it, and what faults leave behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from tests.bag_cases import START, TYPES, axes, block, operation, write
from turnmill_ros.bag import BagWriter, bag_info, raw_messages, read_bag, recover, software_versions
from turnmill_ros.conversions import axes_to_message, block_to_message
from turnmill_ros.errors import InputError, RecordingError
from turnmill_ros.interfaces import own_texts, type_hash


@pytest.fixture
def bag(tmp_path) -> Path:
    return write(tmp_path / "cut.mcap", map(block, range(100)))


@given(st.lists(st.tuples(st.sampled_from(["/a", "/b"]), st.integers(0, 2**62), st.integers(0, 2**62),
                          st.binary(max_size=300)), max_size=40),
       st.sampled_from(["zstd", "lz4", "none"]))
@settings(deadline=None, max_examples=40)
def test_bytes_and_times_come_back_in_order_of_log_time(tmp_path_factory, messages, compression):
    path = tmp_path_factory.mktemp("bag") / "any.mcap"
    with BagWriter(path, compression=compression, versions={}) as writer:
        for topic, log_ns, publish_ns, data in messages:
            writer.write_raw(topic, "std_msgs/msg/Float64", data, log_ns, publish_ns)
    read = [(m.topic, m.log_time_ns, m.publish_time_ns, m.data) for m in raw_messages(path)]
    assert read == sorted(messages, key=lambda message: message[1])


def test_rosbags_opens_and_decodes_every_message(bag):
    with AnyReader([bag]) as reader:
        stamps = [reader.deserialize(data, c.msgtype).header.stamp.sec for c, _, data in reader.messages()]
        assert len(stamps) == reader.message_count == 201
        counts = {c.topic: c.msgcount for c in reader.connections}
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert counts == {"/joint_states": 100, "/sensor_blocks": 100, "/operation": 1}
    assert qos["/operation"].durability.name == "TRANSIENT_LOCAL"
    assert qos["/sensor_blocks"].depth == 500


def test_mcap_ros2_opens_and_decodes_every_message(bag):
    with bag.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        decoded = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()]
        assert reader.get_header().profile == "ros2"
    samples = [message.samples for topic, message in decoded if topic == "/sensor_blocks"]
    assert len(decoded) == 201
    assert samples[7] == block(7).samples.reshape(-1).tolist()


def test_file_carries_texts_with_comments_hashes_operation_and_versions(bag):
    with bag.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    schemas = {schema.name: schema for schema in summary.schemas.values()}
    text = schemas["turnmill_msgs/msg/SensorBlock"].data.decode()
    assert own_texts()["turnmill_msgs/msg/SensorBlock"] in text
    assert own_texts()["turnmill_msgs/msg/SensorChannel"] in text
    assert {schema.encoding for schema in schemas.values()} == {"ros2msg"}
    channel = next(c for c in summary.channels.values() if c.topic == "/sensor_blocks")
    assert channel.message_encoding == "cdr"
    assert channel.metadata["topic_type_hash"] == type_hash("turnmill_msgs/msg/SensorBlock")
    assert metadata["operation"] == {
        "name": operation().name, "sha256": operation().sha256, "yaml": operation().text}
    assert metadata["versions"] == {"turnmill": "test"}


def test_versions_name_the_commit_of_a_checkout(project):
    versions = software_versions()
    assert {"python", "numpy", "mcap"} <= versions.keys()
    assert ("git_commit" in versions) == (project / ".git").exists()


def test_chunks_close_after_half_a_second_or_64_kilobytes(tmp_path):
    slow = write(tmp_path / "slow.mcap", (block(k, rows=1) for k in range(200)), compression="none")
    fast = write(tmp_path / "fast.mcap", (block(k, rows=1280) for k in range(200)), compression="none")
    for path, by_time in ((slow, True), (fast, False)):
        with path.open("rb") as stream:
            chunks = make_reader(stream).get_summary().chunk_indexes
        assert len(chunks) > 4
        assert all(c.message_end_time - c.message_start_time <= 500_000_000 for c in chunks)
        assert all(c.uncompressed_size < 64 * 1024 + 12_000 for c in chunks)
        spans = [c.message_end_time - c.message_start_time for c in chunks[1:-1]]
        assert (min(spans) > 450_000_000) == by_time


def test_same_messages_give_the_same_bytes(tmp_path):
    first, second = (write(tmp_path / f"{name}.mcap", map(block, range(30))).read_bytes() for name in "ab")
    assert first == second


def test_existing_output_is_refused_unless_told(tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(InputError, match=r"cut\.mcap: output exists"):
        BagWriter(path)
    assert path.read_bytes() == b"precious"
    write(path, [block(0)], overwrite=True)
    assert bag_info(path).message_count == 3


def test_output_that_appears_meanwhile_is_kept(tmp_path):
    path = tmp_path / "cut.mcap"
    writer = BagWriter(path)
    writer.write("/joint_states", axes_to_message(axes(START), TYPES), START)
    path.write_bytes(b"precious")
    with pytest.raises(RecordingError, match=r"cut\.mcap\.part: another file"):
        writer.close()
    assert path.read_bytes() == b"precious"


def test_unfinished_recording_is_not_overwritten(tmp_path):
    part = tmp_path / "cut.mcap.part"
    part.write_bytes(b"precious")
    with pytest.raises(InputError, match=r"turnmill recover .*cut\.mcap\.part"):
        BagWriter(tmp_path / "cut.mcap")
    assert part.read_bytes() == b"precious"


@pytest.mark.parametrize(("name", "options", "text"), [
    ("cut.bag", {}, r"ends in \.mcap"), ("cut.mcap", {"compression": "rar"}, "zstd or lz4 or none"),
    ("missing/cut.mcap", {}, "cannot write"),
])
def test_outputs_that_cannot_be_written_are_refused(tmp_path, name, options, text):
    with pytest.raises(InputError, match=text):
        BagWriter(tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


def test_interrupted_conversion_leaves_no_file(tmp_path):
    with pytest.raises(KeyboardInterrupt), BagWriter(tmp_path / "cut.mcap"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_unknown_type_and_negative_time_are_refused(tmp_path):
    with BagWriter(tmp_path / "cut.mcap") as writer:
        with pytest.raises(InputError, match="message type is unknown"):
            writer.write_raw("/a", "no_msgs/msg/Such", b"", 1)
        with pytest.raises(InputError, match="expected a time >= 0 ns"):
            writer.write_raw("/a", "std_msgs/msg/Float64", b"", -1)
        writer.write_raw("/a", "std_msgs/msg/Float64", b"", 1)
    assert bag_info(tmp_path / "cut.mcap").message_count == 1


def test_recording_in_progress_is_complete_after_every_chunk(tmp_path):
    writer = BagWriter(tmp_path / "cut.mcap")
    for k in range(10):
        writer.write("/sensor_blocks", block_to_message(block(k), TYPES), START + k)
    writer.flush()
    assert sum(1 for _ in read_bag(writer.part)) == 10
    writer.write("/sensor_blocks", block_to_message(block(10), TYPES), START + 10)
    assert writer.close() == tmp_path / "cut.mcap"
    assert sum(1 for _ in read_bag(tmp_path / "cut.mcap")) == 11
    assert not writer.part.exists()


def _run(code: str, folder: Path, **options):
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env={**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}, **options)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on this system")
def test_killed_writer_loses_less_than_the_last_second(tmp_path):
    """A process that writes in real time and is killed: all but the open chunk is there."""
    process = _run("""
        import time
        from tests.bag_cases import *
        writer, k = BagWriter("cut.mcap"), 0
        begin = time.monotonic()
        while True:
            one = block(k)
            while time.monotonic() - begin < (end_ns(one) - START) * 1e-9:
                time.sleep(0.001)
            writer.write("/sensor_blocks", block_to_message(one, TYPES), end_ns(one))
            print(end_ns(one), flush=True)
            k += 1
        """, tmp_path)
    last = 0
    for line in process.stdout:
        last = int(line)
        if last - START > 1_300_000_000:
            process.kill()
            break
    process.communicate()
    done = recover(tmp_path / "cut.mcap.part", tmp_path / "saved.mcap")
    assert last - done.end_ns < 1_000_000_000
    stamps = [message.message.first_sample for message in read_bag(tmp_path / "saved.mcap")]
    assert stamps == list(range(0, 128 * len(stamps), 128))
    with AnyReader([tmp_path / "saved.mcap"]) as reader:
        assert reader.message_count == done.messages == len(stamps)


@pytest.mark.skipif(sys.platform == "win32", reason="no RLIMIT_FSIZE on this system")
@pytest.mark.parametrize("limit", [150_000, 150_050, 151_000, 200_000])
def test_full_disk_leaves_a_complete_file_and_an_error(tmp_path, limit):
    process = _run(f"""
        import resource
        from tests.bag_cases import *
        from turnmill_ros.errors import RecordingError
        resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
        writer = BagWriter("cut.mcap")
        try:
            for k in range(10_000):
                writer.write("/sensor_blocks", block_to_message(block(k), TYPES), end_ns(block(k)))
        except RecordingError as error:
            print(error)
            print(error.messages, k)
        print(writer.close())
        """, tmp_path)
    out, error = process.communicate()
    assert process.returncode == 0, error
    line, counts, path = out.splitlines()
    saved, written = map(int, counts.split())
    assert line.startswith("cut.mcap: the disk is full; the")
    assert path == "cut.mcap"
    assert 0 < saved <= written
    assert (written - saved) * 0.02 <= 0.6  # seconds in the chunk that did not fit
    blocks = [message.message.first_sample // 128 for message in read_bag(tmp_path / path)]
    assert blocks == list(range(saved))
    with AnyReader([tmp_path / path]) as reader:
        assert sum(1 for _ in reader.messages()) == saved


@pytest.mark.skipif(sys.platform == "win32", reason="no RLIMIT_FSIZE on this system")
def test_disk_that_fills_while_closing_costs_only_the_index(tmp_path):
    """Limits from the last chunk's end to the whole file: all messages are there, only the index is not."""
    whole = write(tmp_path / "whole.mcap", map(block, range(60)))
    with whole.open("rb") as stream:
        last = make_reader(stream).get_summary().chunk_indexes[-1]
    data_end = last.chunk_start_offset + last.chunk_length + last.message_index_length
    process = _run(f"""
        import resource
        from tests.bag_cases import *
        from turnmill_ros.errors import RecordingError
        size = {whole.stat().st_size}
        for limit in range(size - 50, {data_end} + 50, -997):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
            try:
                write(Path(f"limit_{{limit}}.mcap"), map(block, range(60)))
                print("no error")
            except RecordingError as error:
                print(limit, error.messages)
        """, tmp_path)
    out, error = process.communicate()
    assert process.returncode == 0, error
    assert len(out.splitlines()) > 3
    for line in out.splitlines():
        limit, saved = map(int, line.split())
        assert saved == 121 == bag_info(tmp_path / f"limit_{limit}.mcap").message_count
