"""Salvage of truncated and damaged recordings."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from tests.bag_cases import block, write
from turnmill_ros.bag import bag_info, raw_messages, read_bag, recover
from turnmill_ros.errors import InputError


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("bag") / "whole.mcap", map(block, range(120)))


def _chunks(path: Path):
    with path.open("rb") as stream:
        return make_reader(stream).get_summary().chunk_indexes


def _messages(path: Path):
    return [(m.topic, m.log_time_ns, m.publish_time_ns, m.data) for m in raw_messages(path)]


@given(st.data())
@settings(deadline=None, max_examples=60)
def test_truncated_anywhere_all_whole_chunks_are_saved(whole, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("cut")
    content = whole.read_bytes()
    length = data.draw(st.integers(0, len(content) - 1))
    (folder / "cut.mcap").write_bytes(content[:length])
    saved = [c for c in _chunks(whole) if c.chunk_start_offset + c.chunk_length <= length]
    if not saved:
        with pytest.raises(InputError):
            recover(folder / "cut.mcap", folder / "out.mcap")
        assert [path.name for path in folder.iterdir()] == ["cut.mcap"]
        return
    done = recover(folder / "cut.mcap", folder / "out.mcap")
    original = _messages(whole)
    assert _messages(folder / "out.mcap") == original[: done.messages]
    assert done.end_ns == saved[-1].message_end_time
    assert done.damaged_chunks == 0
    if done.complete:
        assert done.messages == len(original)
        assert done.lost == "nothing"
    else:
        assert done.lost_spans_ns[0][0] >= done.end_ns
        assert "messages from" in done.lost


@given(st.data())
@settings(deadline=None, max_examples=60)
def test_damaged_anywhere_only_true_messages_are_saved(whole, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("flip")
    content = bytearray(whole.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    (folder / "flip.mcap").write_bytes(content)
    try:
        done = recover(folder / "flip.mcap", folder / "out.mcap")
    except InputError:
        assert not (folder / "out.mcap").exists()
        return
    original = {(topic, message): None for topic, _, _, message in _messages(whole)}
    read = [(topic, message) for topic, _, _, message in _messages(folder / "out.mcap")]
    assert len(read) == done.messages
    assert set(read) <= original.keys()


def test_a_damaged_chunk_costs_only_itself_and_its_span_is_told(whole, tmp_path):
    chunks = _chunks(whole)
    content = bytearray(whole.read_bytes())
    content[chunks[1].chunk_start_offset + chunks[1].chunk_length // 2] ^= 0xFF
    (tmp_path / "bad.mcap").write_bytes(content)
    done = recover(tmp_path / "bad.mcap", tmp_path / "out.mcap")
    assert (done.damaged_chunks, done.complete, done.lost_bytes) == (1, False, 0)
    assert done.lost_spans_ns == ((chunks[1].message_start_time, chunks[1].message_end_time),)
    kept = {m.log_time_ns for m in raw_messages(tmp_path / "out.mcap")}
    assert {c.message_start_time for c in chunks if c is not chunks[1]} <= kept
    assert chunks[1].message_start_time + 20_000_000 not in kept
    assert bag_info(tmp_path / "out.mcap").metadata["recovery"]["damaged_chunks"] == "1"


def test_the_time_from_which_messages_are_lost_is_told(whole, tmp_path):
    chunk = _chunks(whole)[2]
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[: chunk.chunk_start_offset + 500])
    done = recover(tmp_path / "cut.mcap", tmp_path / "out.mcap")
    assert done.lost_spans_ns == ((chunk.message_start_time, None),)
    assert done.lost_bytes == 500
    since = (chunk.message_start_time - done.start_ns) * 1e-9
    assert done.lost == f"messages from {since:.3f} s on; 500 bytes at the end"


def test_recovered_file_keeps_metadata_schemas_and_quality_of_service(whole, tmp_path):
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-100])
    done = recover(tmp_path / "cut.mcap", tmp_path / "out.mcap")
    assert done.complete
    before, after = bag_info(whole), bag_info(tmp_path / "out.mcap")
    assert after.topics == before.topics
    assert after.metadata.pop("recovery")["reached_end"] == "true"
    assert after.metadata == before.metadata
    with (tmp_path / "out.mcap").open("rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
    assert all("offered_qos_profiles" in channel.metadata for channel in channels)


def test_whole_file_is_copied_whole(whole, tmp_path):
    done = recover(whole, tmp_path / "out.mcap")
    assert done.complete
    assert _messages(tmp_path / "out.mcap") == _messages(whole)


def test_existing_output_and_other_files_are_left_alone(whole, tmp_path):
    out = tmp_path / "out.mcap"
    out.write_bytes(b"precious")
    with pytest.raises(InputError, match="output exists"):
        recover(whole, out)
    assert out.read_bytes() == b"precious"
    for content in (b"", b"RIFF", b"\x89MCAP0\r\n"):
        (tmp_path / "odd.mcap").write_bytes(content)
        with pytest.raises(InputError, match="recovered"):
            recover(tmp_path / "odd.mcap", tmp_path / "new.mcap")
        assert not (tmp_path / "new.mcap").exists()
    with pytest.raises(InputError, match="cannot read"):
        recover(tmp_path / "missing.mcap", tmp_path / "new.mcap")


@pytest.mark.parametrize("chunked", [True, False])
def test_recordings_of_other_makers_are_salvaged_too(tmp_path, chunked):
    """No chunks, another encoding, an attachment: copied as they are."""
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=chunked)
        writer.start()
        schema = writer.register_schema("Door", "jsonschema", b"{}")
        channel = writer.register_channel("door", "json", schema)
        writer.add_attachment(1, 2, "notes.txt", "text/plain", b"hello")
        for k in range(10):
            writer.add_message(channel, k, b"{}", k, k)
        if chunked:
            writer.flush()
    with path.open("ab") as stream:
        stream.write(b"\x05" + bytes(4))
    done = recover(path, tmp_path / "out.mcap")
    assert (done.messages, done.lost_bytes, done.complete) == (10, 5, False)
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream)
        found = [(schema.name, channel.message_encoding, message.data, message.sequence)
                 for schema, channel, message in reader.iter_messages()]
        assert [attachment.data for attachment in reader.iter_attachments()] == [b"hello"]
    assert found == [("Door", "json", b"{}", k) for k in range(10)]


def test_read_after_recovery_is_gapless(whole, tmp_path):
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:60_000])
    recover(tmp_path / "cut.mcap", tmp_path / "out.mcap")
    first = [m.message.first_sample for m in read_bag(tmp_path / "out.mcap", ["sensor_blocks"])]
    assert first == list(range(0, 128 * len(first), 128))
