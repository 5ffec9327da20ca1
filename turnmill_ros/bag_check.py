"""Checks of a recording before it is trusted: order, gaps, overlap, values, units, schemas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from turnmill_core.machine.axes import AxisState
from turnmill_core.monitoring.blocks import SensorBlock, Status
from turnmill_core.monitoring.sensors import PLAUSIBLE, calibrate
from turnmill_core.operation import Operation
from turnmill_core.operation_sensors import NO_SENSORS
from turnmill_ros import topics as table
from turnmill_ros.bag_read import BagInfo, TopicInfo, bag_info, read_bag
from turnmill_ros.conversions import axes_from_message, block_from_message, operation_from_message
from turnmill_ros.decoding import decoder
from turnmill_ros.errors import InputError

Severity = Literal["error", "warning", "note"]

UNITS = {
    "sound_pressure": "Pa", "displacement": "m", "acceleration": "m/s2", "force": "N", "torque": "N m", "power": "W",
    "voltage": "V", "velocity": "m/s",
}
"""SI unit of every quantity that a sensor channel may have; "1" says that the scale is unknown."""

MAX_TRAVEL = 20.0
"""Largest plausible coordinate of a linear axis [m]."""
MAX_SPINDLE_SPEED = 2.5e4
"""Largest plausible spindle speed [rad/s] (240 000 rpm)."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or notable.

    severity: "error" (no verdict can be trusted), "warning" (verdicts may be UNKNOWN or doubtful) or "note"; code: a
    short fixed word; topic: or ""; time_s: first occurrence, seconds from the recording's start, None where it
    has no time; count: occurrences; text: one line for people.
    """

    severity: Severity
    code: str
    topic: str
    text: str
    time_s: float | None = None
    count: int = 1


@dataclass
class _Findings:
    """Findings with repetitions counted."""

    start_ns: int
    found: dict[tuple[str, str], Finding] = field(default_factory=dict)

    def add(self, severity: Severity, code: str, topic: str, text: str, stamp_ns: int | None = None) -> None:
        known = self.found.get((code, topic))
        if known is not None:
            self.found[code, topic] = replace(known, count=known.count + 1)
        else:
            time_s = None if stamp_ns is None else (stamp_ns - self.start_ns) * 1e-9
            self.found[code, topic] = Finding(severity, code, topic, text, time_s)


def check_bag(path: str | Path) -> list[Finding]:
    """All findings on a recording, errors first; an empty list: nothing to complain about.

    A file that cannot be read is a finding, not an exception.
    """
    try:
        info = bag_info(path)
    except InputError as error:
        return [Finding("error", "unreadable", "", str(error))]
    findings = _Findings(info.start_ns or 0)
    readable = set(_check_topics(info, findings))
    if info.message_count == 0:
        findings.add("error", "no_messages", "", "the recording holds no message")
    elif not any(t.type == table.SENSOR_BLOCKS.type and t.count for t in info.topics):
        findings.add("error", "no_sensor_topic", "", f"no topic of type {table.SENSOR_BLOCKS.type}: nothing to judge")
    try:
        _check_messages(path, readable, findings)
    except InputError as error:
        findings.add("error", "unreadable", error.key or "", str(error))
    order = ("error", "warning", "note")
    return sorted(findings.found.values(), key=lambda f: (order.index(f.severity), f.time_s or 0.0, f.code, f.topic))


def _check_topics(info: BagInfo, findings: _Findings) -> Iterator[str]:
    """Findings on topics and schemas; yields the inputs that can be decoded."""
    for topic in info.topics:
        entry = table.find(topic.name)
        if entry is None:
            continue
        if topic.type != entry.type:
            findings.add("error", "other_type", topic.name, f"type is {topic.type}, expected {entry.type}")
        elif topic.encoding != "cdr" or topic.schema_encoding != "ros2msg":
            findings.add("error", "other_encoding", topic.name,
                         f"{topic.encoding} with schema {topic.schema_encoding}, expected cdr with ros2msg")
        elif _schema_fits(topic, findings) and entry.direction == "input":
            yield topic.name
    present = {t.type for t in info.topics if t.count}
    if table.OPERATION.type not in present:
        findings.add("warning", "no_operation", "", "no operation in the recording: one has to be given")
    if table.JOINT_STATES.type not in present:
        findings.add("note", "no_axis_states", "", "no axis states: the operation's nominal spindle speed is used")


def _schema_fits(topic: TopicInfo, findings: _Findings) -> bool:
    try:
        made = decoder(topic.type, topic.schema)
    except InputError as error:
        findings.add("error", "other_schema", topic.name, str(error))
        return False
    if made.upgrades:
        lacking = f"lacks {', '.join(made.missing)}" if made.missing else "fields differ"
        unknown = f"; fields not known here are ignored: {', '.join(made.extra)}" if made.extra else ""
        findings.add("note", "other_schema", topic.name, f"another version of {topic.type}: {lacking}{unknown}")
    return True


def _check_messages(path: str | Path, readable: set[str], findings: _Findings) -> None:
    streams: dict[tuple[str, str], SensorBlock] = {}
    axes: dict[str, AxisState] = {}
    operations: dict[str, Operation] = {}
    sensors = NO_SENSORS
    spans: dict[str, tuple[int, int]] = {}
    for topic, _, message in read_bag(path, readable) if readable else ():
        kind = message.__msgtype__
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        try:
            if kind == table.SENSOR_BLOCKS.type:
                block = calibrate(sensors, block_from_message(message))
                _check_block(topic, block, streams.get((topic, block.device)), findings)
                streams[topic, block.device] = block
                _widen(spans, "blocks", stamp, _end_ns(block))
            elif kind == table.JOINT_STATES.type:
                state = axes_from_message(message)
                _check_axes(topic, state, axes.get(topic), findings)
                axes[topic] = state
                _widen(spans, "axes", stamp, stamp)
            elif kind == table.OPERATION.type:
                operations[message.sha256] = operation_from_message(message)
                sensors = operations[message.sha256].sensors
        except ValueError as error:
            findings.add("error", "bad_message", topic, str(error), stamp)
    _check_whole(streams, operations, spans, findings)


def _end_ns(block: SensorBlock) -> int:
    return block.stamp_ns + round(len(block.samples) / block.sample_rate * 1e9)


def _check_block(topic: str, block: SensorBlock, last: SensorBlock | None, findings: _Findings) -> None:
    def say(severity: Severity, code: str, text: str) -> None:
        findings.add(severity, code, topic, text, block.stamp_ns)

    if len(block.samples) == 0:
        say("warning", "empty_block", f"block of {block.device} without samples")
    bad = ~np.isfinite(block.samples)
    for k, channel in enumerate(block.channels):
        where = f"channel {channel.name} of {block.device}"
        if bad[:, k].any():
            say("warning", "not_finite", f"{where}: {int(bad[:, k].sum())} of {len(bad)} samples are not finite")
        expected = UNITS.get(channel.quantity)
        if channel.unit not in PLAUSIBLE and channel.unit != "1":
            say("warning", "unit", f"{where}: unit {channel.unit!r} is no SI unit of a sensor")
        elif expected is not None and channel.unit not in (expected, "1"):
            say("warning", "unit", f"{where}: {channel.quantity} in {channel.unit!r}, expected {expected}")
        peak = float(np.abs(block.samples[~bad[:, k], k]).max(initial=0.0))
        if peak > PLAUSIBLE.get(channel.unit, np.inf):
            say("warning", "implausible", f"{where}: {peak:g} {channel.unit} is beyond {PLAUSIBLE[channel.unit]:g}; "
                                          "is the unit right?")
        if channel.status & Status.SATURATED:
            say("warning", "saturated", f"{where}: at the ends of its range")
        if channel.status & Status.DEAD:
            say("warning", "dead", f"{where}: reported by the device")
    if last is None:
        return
    if (block.stream_id, block.sample_rate, [c.name for c in block.channels]) != (
            last.stream_id, last.sample_rate, [c.name for c in last.channels]):
        if block.stream_id == last.stream_id:
            say("error", "stream_changed", f"{block.device}: rate or channels change within a stream")
        else:
            say("note", "stream_restart", f"{block.device}: the device started a new stream")
        return
    missing = block.first_sample - last.end_sample
    if block.first_sample < last.first_sample:
        say("error", "order", f"{block.device}: block {block.first_sample} comes after {last.first_sample}")
    elif missing < 0:
        say("warning", "overlap", f"{block.device}: {-missing} samples are there twice")
    elif missing > 0:
        say("warning", "gap", f"{block.device}: {missing} samples ({missing / block.sample_rate:.3g} s) are missing")
    drift = (block.stamp_ns - last.stamp_ns) * 1e-9 - (block.first_sample - last.first_sample) / block.sample_rate
    if abs(drift) > max(0.5 * len(block.samples) / block.sample_rate, 1e-3):
        say("warning", "stamp", f"{block.device}: stamps and sample count disagree by {drift:.3g} s")


def _check_axes(topic: str, state: AxisState, last: AxisState | None, findings: _Findings) -> None:
    values = np.array([state.position, state.velocity])
    if not np.isfinite(values).all():
        findings.add("warning", "not_finite", topic, "axis positions or velocities are not finite", state.stamp_ns)
    if np.abs(values[0, :3]).max() > MAX_TRAVEL:
        findings.add("warning", "implausible", topic, f"linear axis at {np.abs(values[0, :3]).max():g} m; "
                     "are positions in m?", state.stamp_ns)
    if np.abs(values[1, 3:]).max() > MAX_SPINDLE_SPEED:
        findings.add("warning", "implausible_speed", topic, f"rotary axis at {np.abs(values[1, 3:]).max():g} rad/s; "
                     "are speeds in rad/s?", state.stamp_ns)
    if last is not None and state.stamp_ns <= last.stamp_ns:
        findings.add("warning", "order", topic, "axis states are not in order of time", state.stamp_ns)
    elif last is not None and state.stamp_ns - last.stamp_ns > 500_000_000:
        findings.add("warning", "gap", topic, f"no axis state for {(state.stamp_ns - last.stamp_ns) * 1e-9:.3g} s",
                     state.stamp_ns)


def _check_whole(
    streams: dict[tuple[str, str], SensorBlock], operations: dict[str, Operation],
    spans: dict[str, tuple[int, int]], findings: _Findings,
) -> None:
    if len(operations) > 1:
        findings.add("note", "operations", "", f"{len(operations)} different operations in one recording")
    for (topic, device), block in streams.items():
        for op in operations.values():
            if block.sample_rate < 4 * op.tooth_passing_frequency:
                findings.add("warning", "slow_sampling", topic, f"{device}: {block.sample_rate:g} Hz is less than "
                             f"four times the tooth passing frequency {op.tooth_passing_frequency:.4g} Hz")
    blocks, axes = spans.get("blocks"), spans.get("axes")
    if blocks and axes and (axes[0] > blocks[0] + 500_000_000 or axes[1] < blocks[1] - 500_000_000):
        findings.add("warning", "coverage", "", "axis states do not cover all sensor blocks")


def _widen(spans: dict[str, tuple[int, int]], name: str, first_ns: int, last_ns: int) -> None:
    known = spans.get(name, (first_ns, last_ns))
    spans[name] = (min(known[0], first_ns), max(known[1], last_ns))


def describe(finding: Finding) -> str:
    """One line for people."""
    where = f"{finding.topic}: " if finding.topic else ""
    when = "" if finding.time_s is None else f" at {finding.time_s:.3f} s"
    often = "" if finding.count == 1 else f" ({finding.count} times)"
    return f"{finding.severity}: {where}{finding.text}{when}{often}"
