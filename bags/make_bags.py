"""Make the shipped recordings again: python bags/make_bags.py [NAME ...] (default: all but schema_1).

With the pinned libraries on the same kind of processor the same bytes come out. schema_1 holds one message of every
kind in the first version of the message texts; it is made once and kept for ever.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from turnmill_core.machine.axes import AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.prediction import PredictedType, Prior
from turnmill_core.process.scenarios import SCENARIOS, START_NS
from turnmill_ros import conversions, topics
from turnmill_ros.bag import BagWriter, RawMessage, bag_info, raw_messages
from turnmill_ros.interfaces import rosbags_types
from turnmill_ros.simulate import simulate_to_bag

FOLDER = Path(__file__).resolve().parent
FILES = {"demo": "demo_turn_milling"}
"""File names of scenarios that are not called like the scenario."""

GAP = (2.0, 2.3)
"""Blocks that end in this interval [s] are missing in the recording with a gap."""


def simulated(name: str, folder: Path = FOLDER) -> Path:
    """Recording of a scenario, inputs only, with its truth beside it."""
    scenario = SCENARIOS[name]
    operation = read_operation(shipped_operations()[scenario.operation.removesuffix(".yaml")])
    done = simulate_to_bag(
        operation, folder / f"{FILES.get(name, name)}.mcap", duration=scenario.duration, seed=scenario.seed,
        config=scenario.config, overwrite=True, versions={}, metadata={"scenario": {
            "name": name, "what": scenario.what, "seed": str(scenario.seed), "made_by": "bags/make_bags.py",
            "licence": "CC0-1.0"}})
    return done.path


def copied(source: Path, name: str, keep: Callable[[RawMessage], bool], what: str) -> Path:
    """Recording with those messages of `source` that are to be kept."""
    info = bag_info(source)
    kept = {key: value for key, value in info.metadata.items() if key != "scenario"}
    path = source.with_name(f"{name}.mcap")
    with BagWriter(path, overwrite=True, versions={}, metadata={**kept, "scenario": {
            "name": name, "what": what, "made_by": "bags/make_bags.py", "licence": "CC0-1.0"}}) as writer:
        for message in filter(keep, raw_messages(source)):
            writer.write_raw(message.topic, message.type, message.data, message.log_time_ns, message.publish_time_ns)
    return path


def gap(folder: Path = FOLDER) -> Path:
    """The flip recording of the 3-tooth tool without the blocks of 0.3 s."""
    def keep(message: RawMessage) -> bool:
        seconds = (message.log_time_ns - START_NS) * 1e-9
        return message.topic != topics.SENSOR_BLOCKS.absolute() or not GAP[0] <= seconds < GAP[1]

    return copied(folder / "flip_3_teeth.mcap", "gap", keep, "flip_3_teeth without the blocks from 2.0 s to 2.3 s.")


def truncated(folder: Path = FOLDER) -> Path:
    """The first two thirds of the air recording's bytes, as a crash would leave them."""
    content = (folder / "air.mcap").read_bytes()
    path = folder / "truncated.mcap"
    path.write_bytes(content[: 2 * len(content) // 3])
    return path


def first_schema() -> dict[str, object]:
    """What schema_1 holds: values of the core by topic."""
    operation = read_operation(shipped_operations()["thesis_table_4_9"])
    channels = (Channel("mic", "sound_pressure", "Pa", "door", Status.OK),
                Channel("x", "displacement", "m", "tool shank, x_T", Status.SATURATED))
    samples = np.outer(np.arange(16), [0.5, 1e-6]).astype(np.float32)
    prior = Prior(START_NS + 1, PredictedType.HOPF, 1.25, 410.5)
    axes = (0.05, 0.0, 0.1, math.pi / 2, 0.25, 7.5), (0.0, 0.0, 1e-4, 0.0, 0.625, 350.75)
    return {
        topics.OPERATION.name: operation,
        topics.JOINT_STATES.name: AxisState(START_NS + 2, *axes),
        topics.SENSOR_BLOCKS.name: SensorBlock(START_NS + 3, "daq", 7, 4096, 12800.0, channels, samples),
        topics.CHATTER_STATE.name: Verdict(
            START_NS + 4, START_NS + 5, 5375, "daq", 7, "mic", ChatterKind.HOPF, Reason.ASYNCHRONOUS,
            "energy off the spindle's harmonics", 410.25, (298.5, 410.25, 522.0), 111.75, 351.0, SpeedSource.REFINED,
            0.75, 0.125, 0.5, 0.875, prior),
        topics.CUTTING_LOADS.name: SimpleNamespace(
            force_tool_mean=(1.0, -2.0, 3.0), force_tool_peak=(4.0, -5.0, 6.0), force_machine_mean=(-3.0, -1.0, 2.0),
            force_machine_peak=(-6.0, -4.0, 5.0), tool_torque_mean=1.5, tool_torque_peak=2.5, tool_power_mean=525.0,
            workpiece_torque_mean=0.25, workpiece_torque_peak=0.5, workpiece_power_mean=0.125, chip_thickness_max=1e-4,
            cutting_speed=3.5, tooth_passing_frequency=111.75, material_removal_rate=1e-7, in_cut=True),
        topics.STABILITY_MARGIN.name: SimpleNamespace(
            tool_speed=350.75, workpiece_speed=0.625, depth=2e-3, depth_limit=1.6e-3,
            stable_depths=((0.0, 1.6e-3), (2.5e-3, 3e-3)), depth_searched=4e-3, depth_ratio=1.25, spectral_radius=1.25,
            multipliers=(1.0 + 0.75j, 1.0 - 0.75j), predicted_type=PredictedType.HOPF, chatter_frequency=410.5,
            principal_period=0.009, delay=0.009015625, nearest_stable_speed=343.0),
        topics.STABILITY_LOBES.name: SimpleNamespace(
            workpiece_speed=0.625, tool_speeds=np.array([340.0, 345.0, 350.0]), depths=np.array([1e-3, 2e-3]),
            spectral_radius=np.array([[0.5, 0.625, 0.75], [0.875, 1.0, 1.25]]),
            predicted_type=np.array([[2, 2, 2], [2, 4, 3]], dtype=np.uint8),
            depth_limit=np.array([2e-3, 2e-3, 1.5e-3])),
    }


def schema_1(folder: Path = FOLDER) -> Path:
    """One message of every kind of ours; refuses to replace the file, which stands for the first schema."""
    types, values, sha = rosbags_types(), first_schema(), "0" * 64
    stamp = START_NS + 6
    messages = {
        topics.OPERATION: conversions.operation_to_message(values["operation"], START_NS, types),
        topics.JOINT_STATES: conversions.axes_to_message(values["joint_states"], types),
        topics.SENSOR_BLOCKS: conversions.block_to_message(values["sensor_blocks"], types),
        topics.CHATTER_STATE: conversions.verdict_to_message(values["chatter_state"], sha, types),
        topics.CUTTING_LOADS: conversions.loads_to_message(values["cutting_loads"], stamp, sha, types),
        topics.STABILITY_MARGIN: conversions.margin_to_message(values["stability_margin"], stamp, sha, types),
        topics.STABILITY_LOBES: conversions.lobes_to_message(values["stability_lobes"], stamp, sha, types),
    }
    path = folder / "schema_1.mcap"
    with BagWriter(path, versions={}, compression="none", metadata={"scenario": {
            "name": "schema_1", "what": "One message of every kind in the first version of the messages.",
            "made_by": "bags/make_bags.py", "licence": "CC0-1.0"}}) as writer:
        for topic, message in messages.items():
            writer.write(topic.absolute(), message, conversions.time_from_message(message.header.stamp))
    return path


MAKERS: dict[str, Callable[[], Path]] = {
    **{FILES.get(name, name): partial(simulated, name) for name in SCENARIOS}, "gap": gap, "truncated": truncated,
}


def main(names: Iterable[str]) -> None:
    """Make the named recordings, all but schema_1 without names; schema_1 only where it is missing."""
    chosen = list(names) or [*MAKERS, *([] if (FOLDER / "schema_1.mcap").exists() else ["schema_1"])]
    makers = {**MAKERS, "schema_1": schema_1}
    unknown = [name for name in chosen if name not in makers]
    if unknown:
        raise SystemExit(f"unknown recording {', '.join(unknown)}; there are {', '.join(makers)}")
    for name in chosen:
        path = makers[name]()
        print(f"{path.relative_to(FOLDER.parent)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
