"""Faults put into a recording, and what the check says of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.bag_cases import CHANNELS, TYPES, axes, block, end_ns, shifted, with_samples, write
from turnmill_core.monitoring.blocks import Status
from turnmill_ros.bag import BagWriter, check_bag
from turnmill_ros.bag_check import describe
from turnmill_ros.conversions import axes_to_message, block_to_message


def _blocks(count: int = 30):
    return [block(k) for k in range(count)]


def _nan(blocks):
    samples = blocks[4].samples.copy()
    samples[3, 1] = np.nan
    blocks[4] = with_samples(blocks[4], samples=samples)
    return blocks


def _swap(blocks):
    """Two neighbours change their times of arrival."""
    first, second = blocks[6], blocks[7]
    blocks[6] = with_samples(second, stamp_ns=first.stamp_ns)
    blocks[7] = with_samples(first, stamp_ns=second.stamp_ns)
    return blocks


def _replace(k, **changes):
    def change(blocks):
        blocks[k] = with_samples(blocks[k], **changes)
        return blocks
    return change


def _channel(**changes):
    def change(blocks):
        channels = (CHANNELS[0], replace(CHANNELS[1], **changes))
        return [with_samples(one, channels=channels) for one in blocks]
    return change


FAULTS = {
    "none": (lambda blocks: blocks, set()),
    "gap": (lambda blocks: blocks[:9] + blocks[12:], {("warning", "gap")}),
    "lost samples": (lambda blocks: blocks[:9] + [shifted(b, 50) for b in blocks[9:]], {("warning", "gap")}),
    "repeated block": (lambda blocks: blocks[:9] + blocks[8:], {("warning", "overlap"), ("warning", "order")}),
    "overlap": (lambda blocks: blocks[:9] + [shifted(b, -50) for b in blocks[9:]], {("warning", "overlap")}),
    "swapped blocks": (_swap, {("error", "order"), ("warning", "gap"), ("warning", "stamp")}),
    "not a number": (_nan, {("warning", "not_finite")}),
    "restart": (lambda blocks: blocks[:9] + [
        with_samples(b, stream_id=2, first_sample=b.first_sample - 9 * 128) for b in blocks[9:]],
        {("note", "stream_restart")}),
    "other rate": (_replace(5, sample_rate=3200.0), {("error", "stream_changed")}),
    "clock jump": (lambda blocks: blocks[:9] + [
        with_samples(b, stamp_ns=b.stamp_ns + 30_000_000) for b in blocks[9:]], {("warning", "stamp")}),
    "millimetres": (lambda blocks: [
        with_samples(b, samples=b.samples * np.array([1, 1000], dtype=np.float32)) for b in blocks],
        {("warning", "implausible")}),
    "no SI unit": (_channel(unit="mm"), {("warning", "unit")}),
    "unit of another quantity": (_channel(unit="N"), {("warning", "unit")}),
    "unknown scale": (_channel(unit="1", quantity="sound_pressure"), set()),
    "saturated": (_channel(status=Status.SATURATED), {("warning", "saturated")}),
    "dead": (_channel(status=Status.DEAD), {("warning", "dead")}),
    "empty block": (lambda blocks: [*blocks, with_samples(
        shifted(blocks[-1], 128), samples=np.zeros((0, 2), dtype=np.float32))], {("warning", "empty_block")}),
    "slow sampling": (lambda blocks: [
        with_samples(b, sample_rate=128.0, stamp_ns=b.stamp_ns + k * 980_000_000) for k, b in enumerate(blocks)],
        {("warning", "slow_sampling"), ("warning", "gap"), ("warning", "coverage")}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_and_no_other(tmp_path, fault):
    change, expected = FAULTS[fault]
    findings = check_bag(write(tmp_path / "cut.mcap", change(_blocks())))
    assert {(finding.severity, finding.code) for finding in findings} == expected, [describe(f) for f in findings]


def test_repeated_faults_are_counted_with_the_first_time(tmp_path):
    blocks = [block(k) for k in range(40) if k % 10 != 5]
    [finding] = check_bag(write(tmp_path / "cut.mcap", blocks))
    assert (finding.code, finding.count) == ("gap", 4)
    assert finding.time_s == pytest.approx(6 * 0.02, abs=1e-6)
    assert describe(finding) == (
        "warning: /sensor_blocks: daq: 128 samples (0.02 s) are missing at 0.120 s (4 times)")


def test_what_is_missing_is_said(tmp_path):
    nothing = tmp_path / "nothing.mcap"
    BagWriter(nothing).close()
    assert {"no_messages", "no_operation"} <= {finding.code for finding in check_bag(nothing)}
    no_sensor = write(tmp_path / "no_sensor.mcap", [])
    assert ("error", "no_sensor_topic") in {(f.severity, f.code) for f in check_bag(no_sensor)}
    bare = write(tmp_path / "bare.mcap", _blocks(), with_axes=False, with_operation=False)
    assert {f.code for f in check_bag(bare)} == {"no_axis_states", "no_operation"}


def test_topic_of_another_type_is_an_error(tmp_path):
    with BagWriter(tmp_path / "odd.mcap") as writer:
        writer.write("/sensor_blocks", axes_to_message(axes(1), TYPES), 1)
    assert ("error", "other_type") in {(f.severity, f.code) for f in check_bag(tmp_path / "odd.mcap")}


@pytest.mark.parametrize(("change", "code"), [
    ({"position": (40.0, 0.0, 100.0, 1.57, 0.1, 3.0)}, "implausible"),
    ({"velocity": (0.0, 0.0, 0.0, 0.0, 0.6, 35_000.0)}, "implausible_speed"),
    ({"velocity": (0.0, 0.0, 0.0, 0.0, float("nan"), 350.0)}, "not_finite"),
    ({"stamp_ns": 1}, "order"),
    ({"stamp_ns": end_ns(block(60))}, "gap"),
])
def test_faults_of_axis_states_are_found(tmp_path, change, code):
    with BagWriter(tmp_path / "cut.mcap") as writer:
        for one in _blocks():
            writer.write("/sensor_blocks", block_to_message(one, TYPES), end_ns(one))
            writer.write("/joint_states", axes_to_message(axes(one.stamp_ns), TYPES), end_ns(one))
        last = replace(axes(end_ns(one)), **change)
        writer.write("/joint_states", axes_to_message(last, TYPES), end_ns(one))
    codes = {(finding.topic, finding.code) for finding in check_bag(tmp_path / "cut.mcap")}
    assert codes == {("/joint_states", code), ("", "no_operation")}


def test_bad_messages_are_named(tmp_path):
    def odd(message):
        message.samples = message.samples[:-1]
        return message

    findings = check_bag(write(tmp_path / "odd.mcap", _blocks(3), change=odd))
    assert [(f.severity, f.code, f.count) for f in findings] == [("error", "bad_message", 3)]
    assert "expected a multiple of the 2 channels" in findings[0].text


def test_axis_states_that_end_early_are_found(tmp_path):
    with BagWriter(tmp_path / "cut.mcap") as writer:
        for k, one in enumerate(_blocks(60)):
            writer.write("/sensor_blocks", block_to_message(one, TYPES), end_ns(one))
            if k < 20:
                writer.write("/joint_states", axes_to_message(axes(one.stamp_ns), TYPES), end_ns(one))
    assert {"coverage"} <= {finding.code for finding in check_bag(tmp_path / "cut.mcap")}
