"""Every node in one table: what it reads and writes, and its place in the order of start and stop.

The graph, the launch files and the documentation are made from it; nothing here needs ROS.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from turnmill_ros.topics import (
    CHATTER_STATE,
    CUTTING_LOADS,
    DIAGNOSTICS,
    FORCE_SCALE,
    INPUTS,
    JOINT_STATES,
    OPERATION,
    OUTPUTS,
    PLAN_SUGGESTION,
    PLOTS,
    SENSOR_BLOCKS,
    STABILITY_LOBES,
    STABILITY_MARGIN,
    WRENCH_MACHINE,
    WRENCH_MEASURED,
    WRENCH_TOOL,
    Topic,
    recorded_name,
)

Role = Literal["server", "source", "consumer", "recorder"]


@dataclass(frozen=True)
class NodeKind:
    """A node: module turnmill_ros.nodes.NAME; what it does; topics that it reads and writes.

    role: "server" has no lifecycle; a "source" is started last and stopped first, the recorder the reverse.
    """

    name: str
    role: Role
    inputs: tuple[Topic, ...]
    outputs: tuple[Topic, ...]
    description: str

    @property
    def module(self) -> str:
        """Name of the module that ``python -m`` runs."""
        return f"turnmill_ros.nodes.{self.name}"


_PLOT = {topic.name.removeprefix("plot/"): topic for topic in PLOTS}
LOAD_PLOTS = tuple(_PLOT[name] for name in ("resultant_force", "tool_torque", "tool_power"))
MARGIN_PLOTS = tuple(_PLOT[name] for name in ("depth", "depth_ratio", "spectral_radius"))
VERDICT_PLOTS = tuple(
    _PLOT[name] for name in ("asynchronous_ratio", "half_order_ratio", "chatter_frequency", "spindle_speed"))

KINDS = {kind.name: kind for kind in (
    NodeKind("operation_server", "server", (), (OPERATION,),
             "owns the operation: publishes it latched and replaces it on request"),
    NodeKind("controller", "source", (OPERATION,), (JOINT_STATES,),
             "simulated machine controller: runs the operation's schedule"),
    NodeKind("process_simulator", "source", (OPERATION, JOINT_STATES), (SENSOR_BLOCKS,),
             "simulated cutting process and sensors, driven by the axis states"),
    NodeKind("player", "source", (), INPUTS, "plays the inputs of a recording"),
    NodeKind("force_predictor", "consumer", (OPERATION, JOINT_STATES, SENSOR_BLOCKS, WRENCH_MEASURED),
             (CUTTING_LOADS, WRENCH_TOOL, WRENCH_MACHINE, FORCE_SCALE, *LOAD_PLOTS),
             "predicts forces, torques and powers, and compares them with measured ones"),
    NodeKind("stability_monitor", "consumer", (OPERATION, JOINT_STATES),
             (STABILITY_MARGIN, STABILITY_LOBES, *MARGIN_PLOTS), "predicts how far the present cut is from chatter"),
    NodeKind("chatter_monitor", "consumer", (OPERATION, JOINT_STATES, SENSOR_BLOCKS, STABILITY_MARGIN),
             (CHATTER_STATE, *VERDICT_PLOTS), "judges the sensor signal: air, stable, chatter"),
    NodeKind("planner", "consumer", (OPERATION, STABILITY_MARGIN, CHATTER_STATE), (PLAN_SUGGESTION,),
             "suggests a more productive or a stable cut when asked, in a process of its own"),
    NodeKind("dashboard", "server", (
        OPERATION, SENSOR_BLOCKS, CHATTER_STATE, STABILITY_MARGIN, CUTTING_LOADS, PLAN_SUGGESTION), (),
             "shows the running graph as a page in a browser; in a process of its own"),
    NodeKind("recorder", "recorder", (*INPUTS, *(t for t in OUTPUTS if t is not DIAGNOSTICS)), (),
             "records every topic of the table"),
)}


@dataclass(frozen=True)
class NodeSpec:
    """One node of a graph and the parameters that it is started with.

    unused: topics of the node that this run does without, for example an operation that another node publishes;
    match: further counterparts that the node waits for, as topic=count.
    """

    kind: NodeKind
    parameters: Mapping[str, Any] = field(default_factory=dict)
    unused: tuple[Topic, ...] = ()
    match: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the node."""
        return self.kind.name

    def inputs(self) -> tuple[Topic, ...]:
        """Topics that the node reads in this run."""
        return tuple(topic for topic in self.kind.inputs if topic not in self.unused)

    def outputs(self) -> tuple[Topic, ...]:
        """Topics that the node writes in this run."""
        return tuple(topic for topic in self.kind.outputs if topic not in self.unused)


def with_matches(specs: Iterable[NodeSpec], watched: Iterable[Topic] = ()) -> tuple[NodeSpec, ...]:
    """The nodes with parameter `match`: how many counterparts each waits for on its topics before it starts.

    watched: topics to which the graph itself subscribes. A node that has found all its counterparts, which have
    found it, loses no first message.
    """
    specs, watched = tuple(specs), tuple(watched)
    matched = []
    for spec in specs:
        if spec.kind.role == "server":
            matched.append(spec)
            continue
        readers = {t.name: sum(t in other.inputs() for other in specs) + (t in watched) for t in spec.outputs()}
        writers = {t.name: sum(t in other.outputs() for other in specs) for t in spec.inputs()}
        match = [*(f"{name}={count}" for name, count in {**readers, **writers}.items() if count), *spec.match]
        matched.append(replace(spec, parameters={**spec.parameters, "match": match}))
    return tuple(matched)


CHANNELS = ("sound", "tool_x", "tool_y", "workpiece_x", "workpiece_y")
"""Simulated channels by their number: 1 is the sound alone, 5 all of them."""


def live_specs(
    operation_text: str, bag: str | None, *, seed: int = 0, sample_rate: float = 51200.0, channels: int | None = None,
    duration: float = 0.0,
) -> tuple[NodeSpec, ...]:
    """Nodes of a live run: simulated machine and process, predictions, monitor, and the recorder where a bag is named.

    sample_rate [Hz]; channels: how many of CHANNELS, in SI units (None: the operation's sensors in volts, all of
    CHANNELS where it has none); duration [s], 0: until it is stopped.
    """
    chosen: dict[str, dict[str, Any]] = {
        "operation_server": {"operation_text": operation_text},
        "controller": {"duration": float(duration)},
        "process_simulator": {"seed": seed, "sample_rate": round(sample_rate), "channels": list(CHANNELS[:channels]),
                              "volts": channels is None},
        "force_predictor": {}, "stability_monitor": {}, "chatter_monitor": {}, "planner": {},
    }
    if bag is not None:
        chosen["recorder"] = {"bag": bag}
    return tuple(NodeSpec(KINDS[name], parameters) for name, parameters in chosen.items())


def replay_specs(
    bag: str, out: str | None, *, rate: float, operation_text: str | None, prior: str, axes: str,
) -> tuple[NodeSpec, ...]:
    """Nodes of a replay. rate: 0 is maximum speed; prior, axes: parameters of the chatter monitor."""
    common = {"use_sim_time": True, "lossless": True}
    silent = () if operation_text is None else (OPERATION,)
    recorded = (f"{recorded_name(CHATTER_STATE.name)}=1",) if prior == "recorded" else ()
    playing = {"bag": bag, "rate": float(rate), "exclude": ["", *(topic.name for topic in silent)]}
    chosen = [
        NodeSpec(KINDS["player"], playing, silent, recorded),
        NodeSpec(KINDS["force_predictor"], common),
        NodeSpec(KINDS["stability_monitor"], {**common, "every_change": rate == 0.0}),
        NodeSpec(KINDS["chatter_monitor"], {**common, "prior": prior, "axes": axes},
                 () if prior == "live" else (STABILITY_MARGIN,), recorded),
    ]
    if operation_text is not None:
        chosen.append(NodeSpec(KINDS["operation_server"], {"operation_text": operation_text, "use_sim_time": True}))
    if out is not None:
        chosen.append(NodeSpec(KINDS["recorder"], {**common, "bag": out}))
    return tuple(chosen)


def node_table() -> str:
    """The table as Markdown, for docs/nodes.md."""
    rows = ["| node | reads | writes | what it does |", "|---|---|---|---|"]
    for kind in KINDS.values():
        reads = "every topic" if kind.role == "recorder" else ", ".join(f"`{t.name}`" for t in kind.inputs)
        writes = ", ".join(f"`{t.name}`" for t in kind.outputs)
        if kind.name == "player":
            writes += f", `/clock`, `{recorded_name('...')}`"
        rows.append(f"| `{kind.name}` | {reads or '-'} | {writes or '-'} | {kind.description} |")
    return "\n".join(rows) + "\n"
