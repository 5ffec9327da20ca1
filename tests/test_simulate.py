"""Simulated recordings: what stands in them, the truth beside them, the same bytes every time."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.bag_cases import operation
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.simulation import simulate
from turnmill_ros.bag import bag_info, check_bag, read_bag
from turnmill_ros.conversions import axes_from_message, block_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.simulate import START_NS, simulate_to_bag

OP = operation()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return simulate_to_bag(OP, tmp_path_factory.mktemp("sim") / "cut.mcap", duration=0.6, sample_rate=6400.0, seed=4)


def test_recording_is_clean_and_complete(done):
    assert check_bag(done.path) == []
    counts = {topic.name: topic.count for topic in bag_info(done.path).topics}
    assert counts == {"/operation": 1, "/joint_states": done.axis_states, "/sensor_blocks": done.blocks}
    assert (done.blocks, done.axis_states, done.duration) == (30, 151, 0.6)
    assert bag_info(done.path).metadata["operation"]["sha256"] == OP.sha256


def test_blocks_are_those_of_the_simulation(done):
    config = SimulationConfig(sample_rate=6400, channels=("sound", "tool_x"), start_ns=START_NS)
    expected = [block for chunk in simulate(OP, config, 4, duration=0.6) for block in chunk.blocks]
    read = [block_from_message(message) for _, _, message in read_bag(done.path, ["sensor_blocks"])]
    assert [b.stamp_ns for b in read] == [b.stamp_ns for b in expected]
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(read, expected, strict=True))


def test_axis_states_are_those_of_the_controller(done):
    for _, log_ns, message in read_bag(done.path, ["joint_states"]):
        state = axes_from_message(message)
        expected = axis_state_at(OP, (state.stamp_ns - START_NS) * 1e-9, state.stamp_ns)
        assert state.position == pytest.approx(expected.position, rel=1e-12)
        assert state.velocity == pytest.approx(expected.velocity, rel=1e-12)
        assert log_ns == state.stamp_ns


def test_a_block_is_recorded_when_its_last_sample_is_acquired(done):
    order = [log_ns for _, log_ns, _ in read_bag(done.path)]
    assert order == sorted(order)
    for _, log_ns, message in read_bag(done.path, ["sensor_blocks"]):
        block = block_from_message(message)
        assert log_ns == block.stamp_ns + round((len(block.samples) - 1) * 1e9 / 6400)


def test_truth_stands_beside_the_recording(done):
    truth = json.loads(done.truth_path.read_text())
    assert done.truth_path.name == "cut.truth.json"
    assert truth["operation"]["sha256"] == OP.sha256
    assert (truth["seed"], truth["start_time_ns"]) == (4, START_NS)
    assert np.allclose(truth["synchronous_m"], done.truth.synchronous, rtol=1e-5)
    assert np.allclose(truth["time_s"], done.truth.time, rtol=1e-5)
    assert len(truth["in_cut"]) == len(truth["asynchronous_m"]) == len(truth["time_s"]) > 10


def test_same_input_same_bytes(done, tmp_path):
    again = simulate_to_bag(OP, tmp_path / "cut.mcap", duration=0.6, sample_rate=6400.0, seed=4)
    assert again.truth_path.read_bytes() == done.truth_path.read_bytes()
    assert again.path.read_bytes() == done.path.read_bytes()


@pytest.mark.parametrize("number", [1, 5])
def test_channels_by_number(tmp_path, number):
    done = simulate_to_bag(OP, tmp_path / "cut.mcap", duration=0.1, channels=number)
    message = next(read_bag(done.path, ["sensor_blocks"])).message
    names = ["sound", "tool_x", "tool_y", "workpiece_x", "workpiece_y"]
    assert [channel.name for channel in message.channels] == names[:number]


@pytest.mark.parametrize("options", [{"channels": 0}, {"channels": 6}, {"sample_rate": 0.5}, {"duration": -1.0},
                                     {"channels": ["ear"]}])
def test_values_out_of_bounds_leave_no_file(tmp_path, options):
    with pytest.raises(ValueError, match="expected"):
        simulate_to_bag(OP, tmp_path / "cut.mcap", **{"duration": 0.1, **options})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["cut.mcap", "cut.truth.json"])
def test_existing_outputs_are_kept(tmp_path, name):
    (tmp_path / name).write_bytes(b"precious")
    with pytest.raises(InputError, match="output exists"):
        simulate_to_bag(OP, tmp_path / "cut.mcap", duration=0.1)
    assert (tmp_path / name).read_bytes() == b"precious"
    assert len(list(tmp_path.iterdir())) == 1
