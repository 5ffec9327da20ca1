"""Operation files: YAML text -> checked keys and units -> the frozen values of operation.py.

The format is described in docs/operation.md. Nothing of a bad file gets through: every problem is
one :class:`OperationError` line.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import yaml
from pydantic import ValidationError

from .operation import (
    Conditions,
    Operation,
    SchedulePoint,
    Tool,
    Workpiece,
)
from .operation_cutter_schema import profile_of, shape_of
from .operation_errors import OperationError, first_error, shown
from .operation_limits_schema import limits_of
from .operation_material import material_of
from .operation_quantity import parse_quantity
from .operation_schema import (
    ADAPTER,
    SCHEMA_VERSION,
    BarSection,
    MillingFile,
    TurnMillingFile,
    operation_schema,
)
from .operation_sensors_schema import sensors_of
from .operation_stability_schema import process_damping_of, trials_of
from .operation_structure import RIGID, RIGID_IN_MACHINE
from .operation_structure_schema import structure_of
from .operation_table import describe

__all__ = [
    "OperationError", "describe", "operation_schema", "parse_operation", "parse_quantity", "read_operation",
    "shipped_operations",
]

_LARGEST_FILE = 1_000_000
_T = TypeVar("_T")


class _Loader(yaml.SafeLoader):
    """SafeLoader for plain mappings, lists, texts and numbers: no duplicated keys, aliases, tags or dates."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            _refuse("aliases are not used here", event.start_mark)
        if event.tag is not None:
            _refuse(f"the tag {shown(event.tag)} is not used here", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if key in seen:
                _refuse(f"key {shown(key)} stands twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def _refuse(problem: str, mark: Any) -> NoReturn:
    raise yaml.constructor.ConstructorError(None, None, problem, mark)


def read_operation(path: str | Path) -> Operation:
    """Operation from a YAML file; raises OperationError."""
    name = str(path)
    try:
        with open(path, "rb") as file:
            data = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise OperationError(name, "", f"cannot be read ({reason}), expected an operation file") from None
    if len(data) > _LARGEST_FILE:
        raise OperationError(name, "", f"is larger than {_LARGEST_FILE} bytes, expected an operation file")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise OperationError(
            name, "", f"is not UTF-8 text (byte {data[error.start]:#04x} at {error.start}), expected an operation file"
        ) from None
    return parse_operation(text, name)


def parse_operation(text: str, name: str = "<text>") -> Operation:
    """Operation from YAML text; `name` stands for the file in error lines.

    The operation carries the text and the SHA-256 of its UTF-8 bytes. Raises OperationError.
    """
    if len(text) > _LARGEST_FILE:
        raise OperationError(name, "", f"is longer than {_LARGEST_FILE} characters, expected an operation file")
    data = _load(text, name)
    try:
        encoded = text.encode("utf-8")
        model = ADAPTER.validate_python(data)
    except UnicodeEncodeError:
        raise OperationError(name, "", "holds characters that are not UTF-8, expected an operation file") from None
    except ValidationError as error:
        raise first_error(name, error, data) from None
    return _operation(model, name, text, hashlib.sha256(encoded).hexdigest())


def shipped_operations() -> dict[str, Path]:
    """Operation files that come with the package: name -> path, sorted by name."""
    folder = Path(__file__).parent / "operations"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def _load(text: str, name: str) -> dict[str, Any]:
    try:
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"in line {mark.line + 1}, column {mark.column + 1} " if mark else ""
        raise OperationError(name, "", f"{where}is not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        raise OperationError(name, "", f"is not valid YAML: {error}") from None
    if data is None:
        raise OperationError(name, "", "is empty, expected an operation: a mapping that begins with schema: 1")
    if not isinstance(data, dict):
        raise OperationError(name, "", f"holds {shown(data)}, expected a mapping that begins with schema: 1")
    if "schema" not in data:
        raise OperationError(name, "schema", f"is missing, expected {SCHEMA_VERSION}")
    version = data["schema"]
    if isinstance(version, bool) or version != SCHEMA_VERSION:
        raise OperationError(name, "schema", f"is {shown(version)}, expected {SCHEMA_VERSION}")
    return data


def _operation(model: TurnMillingFile | MillingFile, file: str, text: str, sha256: str) -> Operation:
    def built(key: str, make: Callable[[], _T]) -> _T:
        try:
            return make()
        except ValueError as error:
            raise OperationError(file, key, f"holds a wrong value: {error}") from None

    def check(ok: bool, key: str, value: float | str, expected: str) -> None:
        if not ok:
            raise OperationError(file, key, f"is {value}, expected {expected}")

    def mm(value: float) -> str:
        return f"{value * 1e3:.6g} mm"

    section = model.tool
    tool = built("tool", lambda: Tool(
        name=section.name, diameter=section.diameter, teeth=section.teeth, helix_angle=section.helix_angle,
        flute_length=math.inf if section.flute_length is None else section.flute_length,
        pitch_angles=section.pitch_angles, runout=section.runout, structure=structure_of(section.structure, RIGID),
        shape=shape_of(section.shape),
    ))
    workpiece = built("workpiece", lambda: _workpiece(model))
    cut, R = model.cut, tool.radius
    deepest, limit = (workpiece.radius, "bar's radius") if workpiece.is_bar else (workpiece.height, "block's height")
    for index, depth in enumerate([cut.depth, *(p.depth for p in model.schedule)]):
        key = f"schedule[{index - 1}].depth" if index else "cut.depth"
        check(depth < deepest or (depth == deepest and not workpiece.is_bar), key, mm(depth),
              f"less than the {limit} {mm(deepest)}")
        check(depth <= tool.flute_length, key, mm(depth), f"at most the flute length {mm(tool.flute_length)}")
    times = [p.time for p in model.schedule]
    check(len(times) != 1, "schedule", "one point", "at least two points, or none")
    for index in range(1, len(times)):
        check(times[index] > times[index - 1], f"schedule[{index}].time", f"{times[index]:g} s",
              f"a time after {times[index - 1]:g} s")

    if isinstance(model, TurnMillingFile):
        turn = model.cut
        check(turn.workpiece_speed != 0, "cut.workpiece_speed", "0 rpm", "a speed other than 0")
        check(turn.axial_feed <= R * (1 + 1e-12), "cut.axial_feed", f"{turn.axial_feed * 1e3:.6g} mm/rev",
              f"at most the tool radius, {R * 1e3:.6g} mm/rev (a wider cut leaves the round bar in two arcs)")
        immersion, workpiece_speed = turn.axial_feed, turn.workpiece_speed
        feed_speed = turn.axial_feed * abs(workpiece_speed) / (2 * math.pi)
        axial_feed, feed_per_tooth = turn.axial_feed, 0.0
        eccentricity, tilt = turn.eccentricity, turn.tilt
        points = tuple(SchedulePoint(p.time, p.tool_speed, p.workpiece_speed, p.depth) for p in model.schedule)
    else:
        mill = model.cut
        immersion = _milling_immersion(model, tool, workpiece, check, mm)
        workpiece_speed, axial_feed, feed_per_tooth, eccentricity, tilt = 0.0, 0.0, mill.feed_per_tooth, 0.0, 0.0
        feed_speed = feed_per_tooth * tool.teeth * mill.tool_speed / (2 * math.pi)
        points = tuple(SchedulePoint(p.time, p.tool_speed, 0.0, p.depth) for p in model.schedule)
    span = {
        "up": (R - immersion, R), "down": (-R, -R + immersion), "slot": (-R, R),
        "centred": (-immersion / 2, immersion / 2),
    }[cut.sense]
    conditions = built("cut", lambda: Conditions(
        tool_speed=cut.tool_speed, workpiece_speed=workpiece_speed, depth=cut.depth, feed_speed=feed_speed,
        cross_feed_span=span, effective_radius=workpiece.radius - cut.depth if workpiece.is_bar else 0.0,
    ))
    material = built("material", lambda: material_of(model.material, tool, conditions))
    limits = built("limits", lambda: limits_of(model.limits))
    sensors = built("sensors", lambda: sensors_of(model.sensors))
    damping = built("process_damping", lambda: process_damping_of(model.process_damping))
    trials = built("trials", lambda: trials_of(model.trials, workpiece_speed))
    return built("", lambda: Operation(
        name=model.name, process=model.process, machine=model.machine, tool=tool, workpiece=workpiece,
        material=material, conditions=conditions, milling_sense=cut.sense, axial_feed=axial_feed,
        feed_per_tooth=feed_per_tooth, eccentricity=eccentricity, tilt=tilt, schedule=points, limits=limits,
        process_damping=damping, trials=trials, sensors=sensors, sources=model.sources, text=text, sha256=sha256,
    ))


def _milling_immersion(
    model: MillingFile, tool: Tool, block: Workpiece,
    check: Callable[[bool, str, float | str, str], None], mm: Callable[[float], str],
) -> float:
    """Radial immersion [m] of a milling cut, checked against tool and block."""
    sense, given = model.cut.sense, model.cut.radial_immersion
    if given is None:
        check(sense in ("slot", "centred"), "cut.radial_immersion", "missing", "a width of cut in up- and down-milling")
        given = tool.diameter if sense == "slot" else block.width
    key, tiny = "cut.radial_immersion", 1e-9 * tool.diameter
    check(given <= tool.diameter + tiny, key, mm(given), f"at most the tool diameter {mm(tool.diameter)}")
    check(given <= block.width + tiny, key, mm(given), f"at most the block's width {mm(block.width)}")
    if sense == "slot":
        check(abs(given - tool.diameter) <= tiny, key, mm(given), f"the tool diameter {mm(tool.diameter)} in a slot")
    if sense == "centred":
        check(abs(given - block.width) <= tiny, key, mm(given),
              f"the block's width {mm(block.width)} where the tool is centred on it")
    return given


def _workpiece(model: TurnMillingFile | MillingFile) -> Workpiece:
    section = model.workpiece
    structure = structure_of(section.structure, RIGID_IN_MACHINE)
    if isinstance(section, BarSection):
        return Workpiece(name=section.name, diameter=section.diameter, length=section.length, datum=section.datum,
                         structure=structure, profile=profile_of(section.profile),
                         beam=None if section.beam is None else section.beam.value())
    return Workpiece(name=section.name, length=section.length, width=section.width, height=section.height,
                     datum=section.datum, structure=structure)
