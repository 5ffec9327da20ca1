"""The recordings in bags/: what they promise, and the first schema for ever."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.scenarios import SCENARIOS
from turnmill_ros import conversions, topics
from turnmill_ros.bag import bag_info, check_bag, read_bag, recover
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import own_texts

BAGS = Path(__file__).parent.parent / "bags"
SIMULATED = ("demo_turn_milling", "flip_3_teeth", "flip_2_teeth", "runout_2_teeth", "air")


@pytest.fixture(scope="module")
def maker():
    spec = importlib.util.spec_from_file_location("make_bags", BAGS / "make_bags.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _blocks(path):
    return [conversions.block_from_message(message) for _, _, message in read_bag(path, ["sensor_blocks"])]


@pytest.mark.parametrize("name", SIMULATED)
def test_recording_is_clean_and_holds_inputs_only(name):
    path = BAGS / f"{name}.mcap"
    assert check_bag(path) == []
    found = {topic.name.lstrip("/") for topic in bag_info(path).topics}
    assert found == {topic.name for topic in topics.INPUTS} - {topics.WRENCH_MEASURED.name}
    assert path.stat().st_size <= 5_000_000


@pytest.mark.parametrize("name", SIMULATED)
def test_other_readers_open_it(name):
    path = BAGS / f"{name}.mcap"
    count = bag_info(path).message_count
    with AnyReader([path]) as reader:
        assert sum(1 for c, _, data in reader.messages() if reader.deserialize(data, c.msgtype)) == count
    with path.open("rb") as stream:
        decoded = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        assert sum(1 for _ in decoded) == count


@pytest.mark.parametrize("name", SIMULATED)
def test_recording_is_of_the_present_operation_file(name, maker):
    """`make bags` is due where this fails."""
    scenario = next(s for key, s in SCENARIOS.items() if maker.FILES.get(key, key) == name)
    operation = read_operation(shipped_operations()[scenario.operation.removesuffix(".yaml")])
    info = bag_info(BAGS / f"{name}.mcap")
    assert info.metadata["operation"]["sha256"] == operation.sha256
    assert info.metadata["scenario"]["what"] == scenario.what
    assert json.loads((BAGS / f"{name}.truth.json").read_text())["operation"]["sha256"] == operation.sha256
    assert (info.end_ns - info.start_ns) * 1e-9 == pytest.approx(scenario.duration, abs=0.02)


def test_air_is_simulated_to_the_same_samples_again(maker, tmp_path):
    """Regression: the shipped file is what the present simulator makes (no chaos in air, so on any processor)."""
    again, shipped = _blocks(maker.simulated("air", tmp_path)), _blocks(BAGS / "air.mcap")
    assert len(again) == len(shipped)
    assert all(np.allclose(a.samples, b.samples, rtol=1e-4, atol=1e-9) for a, b in zip(again, shipped, strict=True))


def test_truth_of_the_demo_tells_its_story():
    truth = json.loads((BAGS / "demo_turn_milling.truth.json").read_text())
    time, touched = np.array(truth["time_s"]), np.array(truth["touched"])
    assert not touched[time < 1.0].any()
    assert [crossing["rising"] for crossing in truth["crossings"]] == [True, False]
    onset, rescue = (crossing["t_s"] for crossing in truth["crossings"])
    assert 2.5 < onset < rescue < time[-1]
    assert touched[(time > onset) & (time < rescue)].all()
    chatter = [f for f, t in zip(truth["frequency_hz"], time, strict=True) if onset + 0.5 < t < rescue - 0.5]
    assert truth["chatter_frequency_hz"] == pytest.approx(np.median(chatter), rel=1e-3)


@pytest.mark.parametrize("name", ["flip_3_teeth", "flip_2_teeth", "runout_2_teeth", "air"])
def test_truth_of_the_others_knows_no_lasting_asynchronous_vibration(name):
    assert json.loads((BAGS / f"{name}.truth.json").read_text())["chatter_frequency_hz"] is None


def test_gap_misses_what_it_says():
    findings = {f.code: f for f in check_bag(BAGS / "gap.mcap")}
    assert findings.keys() == {"gap"}
    assert "daq" not in findings["gap"].text
    assert findings["gap"].count == 1
    first = [block.first_sample for block in _blocks(BAGS / "gap.mcap")]
    assert max(np.diff(first)) / 12_800 == pytest.approx(0.32, abs=0.021)


def test_truncated_is_refused_and_recovered(tmp_path):
    with pytest.raises(InputError, match="turnmill recover"):
        bag_info(BAGS / "truncated.mcap")
    done = recover(BAGS / "truncated.mcap", tmp_path / "saved.mcap")
    assert not done.complete
    whole = _blocks(BAGS / "air.mcap")
    saved = _blocks(tmp_path / "saved.mcap")
    assert len(whole) / 2 < len(saved) < len(whole)
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(saved, whole, strict=False))


def test_maker_refuses_unknown_names_and_to_replace_the_first_schema(maker):
    with pytest.raises(SystemExit, match="unknown recording nonsense"):
        maker.main(["nonsense"])
    with pytest.raises(InputError, match="output exists"):
        maker.main(["schema_1"])


FIRST_SCHEMA = BAGS / "schema_1.mcap"
MESSAGES = {topic: message for topic, _, message in read_bag(FIRST_SCHEMA)}


def test_first_schema_holds_every_message_of_ours():
    found = {topic.type.split("/")[-1] for topic in bag_info(FIRST_SCHEMA).topics}
    nested = {"SensorChannel", "StabilityPrior"}
    later = {"ForceScale", "PlanSuggestion"}  # came after the first schema
    assert {name.split("/")[-1] for name in own_texts()} <= found | nested | later
    assert not later & found


def _equal(read, expected) -> bool:
    read, expected = np.asarray(read), np.asarray(expected)
    return np.array_equal(read.reshape(expected.shape), expected)


def test_first_schema_reads_for_ever(maker):
    """Each value of the first version comes out as it was put in, whatever the present messages are."""
    values = maker.first_schema()
    block = conversions.block_from_message(MESSAGES["/sensor_blocks"])
    expected: SensorBlock = values["sensor_blocks"]
    assert (block.stamp_ns, block.device, block.stream_id, block.first_sample, block.sample_rate, block.channels) == (
        expected.stamp_ns, expected.device, expected.stream_id, expected.first_sample, expected.sample_rate,
        expected.channels)
    assert np.array_equal(block.samples, expected.samples)
    assert conversions.axes_from_message(MESSAGES["/joint_states"]) == values["joint_states"]
    assert conversions.verdict_from_message(MESSAGES["/chatter_state"]) == values["chatter_state"]
    for name, back in (("cutting_loads", conversions.loads_from_message),
                       ("stability_margin", conversions.margin_from_message),
                       ("stability_lobes", conversions.lobes_from_message)):
        read = back(MESSAGES[f"/{name}"])
        assert all(_equal(read[field], value) for field, value in vars(values[name]).items()), name
        assert MESSAGES[f"/{name}"].operation_hash == "0" * 64


def test_first_schema_is_clean():
    assert [finding for finding in check_bag(FIRST_SCHEMA) if finding.severity == "error"] == []
