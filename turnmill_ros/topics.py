"""Every topic of the suite in one table: name, type, quality of service, rate.

Names are relative, so that a namespace or a remap moves them; ``/clock`` and ``/diagnostics`` are
absolute by ROS custom. Reliability is "reliable" for all of the suite's own topics: a lost block
costs a whole window of verdicts, and the measured loss of reliable delivery with a deep enough
history is none. Depths cover a stall of at least one second at the nominal rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Direction = Literal["input", "output", "clock"]


@dataclass(frozen=True)
class Topic:
    """One topic.

    name: relative to the node's namespace, or absolute; type: "package/msg/Name"; direction:
    "input" is what a machine or a sensor gives, "output" what the suite computes from it, "clock"
    is the simulated time; depth: messages kept (KEEP_LAST); rate [Hz]: nominal, 0 for a topic that
    is published on change only.
    """

    name: str
    type: str
    direction: Direction
    depth: int
    rate: float
    description: str
    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"

    @property
    def latched(self) -> bool:
        """True where a late subscriber still gets the last message."""
        return self.durability == "transient_local"

    def absolute(self, namespace: str = "/") -> str:
        """Full topic name under `namespace`, as it stands in a recording."""
        return self.name if self.name.startswith("/") else f"{namespace.rstrip('/')}/{self.name}"


JOINT_STATES = Topic(
    "joint_states", "sensor_msgs/msg/JointState", "input", 500, 250.0,
    "axes x y z b c and tool spindle s: positions in m and rad, velocities in m/s and rad/s")
SENSOR_BLOCKS = Topic(
    "sensor_blocks", "turnmill_msgs/msg/SensorBlock", "input", 500, 50.0,
    "blocks of 10 to 50 ms of all channels of one acquisition device")
OPERATION = Topic(
    "operation", "turnmill_msgs/msg/Operation", "input", 1, 0.0,
    "operation file text and its sha256", durability="transient_local")
CUTTING_LOADS = Topic(
    "cutting_loads", "turnmill_msgs/msg/CuttingLoads", "output", 100, 50.0,
    "predicted forces, torques and powers over one tool revolution")
WRENCH_TOOL = Topic(
    "wrench/tool", "geometry_msgs/msg/WrenchStamped", "output", 100, 50.0,
    "predicted mean force and torque on the tool, tool frame, in N and N m")
WRENCH_MACHINE = Topic(
    "wrench/machine", "geometry_msgs/msg/WrenchStamped", "output", 100, 50.0,
    "predicted mean force and torque on the tool, machine frame, in N and N m")
WRENCH_MEASURED = Topic(
    "wrench/measured", "geometry_msgs/msg/WrenchStamped", "input", 2000, 1000.0,
    "measured force on the tool, in N; frame_id tool or machine")
FORCE_SCALE = Topic(
    "force_scale", "turnmill_msgs/msg/ForceScale", "output", 100, 5.0,
    "scale of the force coefficients from measured force, torque or spindle power")
CHATTER_STATE = Topic(
    "chatter_state", "turnmill_msgs/msg/ChatterState", "output", 100, 20.0,
    "verdict on one window of the sensor signal")
STABILITY_MARGIN = Topic(
    "stability_margin", "turnmill_msgs/msg/StabilityMargin", "output", 100, 10.0,
    "predicted distance of the present cut from chatter")
STABILITY_LOBES = Topic(
    "stability_lobes", "turnmill_msgs/msg/StabilityLobes", "output", 1, 0.0,
    "stability diagram at the present workpiece speed", durability="transient_local")
PLAN_SUGGESTION = Topic(
    "plan_suggestion", "turnmill_msgs/msg/PlanSuggestion", "output", 1, 0.0,
    "suggested cut with its reasons, after a request to the planner", durability="transient_local")
DIAGNOSTICS = Topic(
    "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "output", 100, 1.0,
    "state of each node: blocks received, index gaps, time since the last input, disk")
CLOCK = Topic(
    "/clock", "rosgraph_msgs/msg/Clock", "clock", 1, 100.0,
    "simulated time of a replay or of the simulated machine", reliability="best_effort")


def _plot(scalar: str, rate: float, description: str) -> Topic:
    return Topic(f"plot/{scalar}", "std_msgs/msg/Float64", "output", 100, rate, description)


PLOTS = (
    _plot("asynchronous_ratio", 20.0, "ChatterState.asynchronous_ratio, 1"),
    _plot("half_order_ratio", 20.0, "ChatterState.half_order_ratio, 1"),
    _plot("chatter_frequency", 20.0, "ChatterState.chatter_frequency, Hz"),
    _plot("spindle_speed", 20.0, "ChatterState.spindle_speed, rad/s"),
    _plot("depth", 5.0, "StabilityMargin.depth, m"),
    _plot("depth_ratio", 5.0, "StabilityMargin.depth_ratio, 1"),
    _plot("spectral_radius", 5.0, "StabilityMargin.spectral_radius, 1"),
    _plot("resultant_force", 50.0, "magnitude of CuttingLoads.force_tool_mean, N"),
    _plot("tool_torque", 50.0, "CuttingLoads.tool_torque_mean, N m"),
    _plot("tool_power", 50.0, "CuttingLoads.tool_power_mean, W"),
)

TOPICS = (
    JOINT_STATES, SENSOR_BLOCKS, OPERATION, CUTTING_LOADS, WRENCH_TOOL, WRENCH_MACHINE, WRENCH_MEASURED,
    FORCE_SCALE, CHATTER_STATE, STABILITY_MARGIN, STABILITY_LOBES, PLAN_SUGGESTION, *PLOTS, DIAGNOSTICS, CLOCK,
)
INPUTS = tuple(topic for topic in TOPICS if topic.direction == "input")
OUTPUTS = tuple(topic for topic in TOPICS if topic.direction == "output")

RECORDED = "recorded"
"""Sub-namespace under which a replay republishes outputs that it finds in a recording."""


def find(name: str) -> Topic | None:
    """The topic of the table that a full or relative topic name stands for, whatever its namespace; else None.

    Names under ``recorded/`` are copies of old outputs and stand for none.
    """
    parts = name.strip("/").split("/")
    if RECORDED in parts:
        return None
    for topic in TOPICS:
        own = topic.name.strip("/").split("/")
        if parts[-len(own):] == own:
            return topic
    return None


def recorded_name(name: str) -> str:
    """Relative name under which a replay publishes a recorded output: ``/x/y`` becomes ``recorded/x/y``."""
    return f"{RECORDED}/{name.strip('/')}"


def topic_table() -> str:
    """The table as Markdown, for docs/topics.md."""
    rows = ["| topic | type | direction | rate | QoS | content |", "|---|---|---|---|---|---|"]
    for t in TOPICS:
        rate = f"{t.rate:g} Hz" if t.rate else "on change"
        qos = f"{t.reliability.replace('_', ' ')}, {'latched' if t.latched else 'volatile'}, depth {t.depth}"
        rows.append(f"| `{t.name}` | `{t.type}` | {t.direction} | {rate} | {qos} | {t.description} |")
    return "\n".join(rows) + "\n"
