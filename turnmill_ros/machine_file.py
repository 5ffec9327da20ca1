"""Machine descriptions: a YAML file with the axes and strokes of a mill-turn machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from turnmill_core.machine.kinematics import DRIVES, NT3150, MachineKinematics, RotaryAxis
from turnmill_core.machine.limits import NT3150_LIMITS, AxisLimits, Five
from turnmill_core.operation import Vector
from turnmill_core.operation_file import parse_quantity
from turnmill_ros.errors import InputError

KEYS = ("name", "b", "c", "tool_axis", "tool_tip", "workpiece_datum", "strokes")


def read_machine(path: Path) -> tuple[MachineKinematics, AxisLimits]:
    """Machine and strokes of a YAML file; what is left out is as on the default machine.

    Keys: name; b and c, each with direction (three numbers) and point (three lengths); tool_axis (three numbers);
    tool_tip, workpiece_datum (three lengths); strokes: per drive x, y, z, b, c the lowest and highest position, or
    null for none. Raises InputError that names file, key, value and what was expected.
    """
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such machine file", file=path) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"not a YAML file: {error}", file=path) from None
    try:
        return _machine(_mapping(found, "machine", KEYS))
    except ValueError as error:
        raise InputError(str(error), file=path) from None


def _machine(values: dict[str, Any]) -> tuple[MachineKinematics, AxisLimits]:
    strokes = _mapping(values.get("strokes", {}), "strokes", DRIVES)
    ends = [(NT3150_LIMITS.lower[k], NT3150_LIMITS.upper[k]) if name not in strokes else _stroke(strokes[name], name)
            for k, name in enumerate(DRIVES)]
    machine = MachineKinematics(
        str(values.get("name", "machine")), _axis(values.get("b", {}), "b", NT3150.b),
        _axis(values.get("c", {}), "c", NT3150.c), _vector(values, "tool_axis", NT3150.tool_axis, _number),
        _vector(values, "tool_tip", NT3150.tool_tip, _length),
        _vector(values, "workpiece_datum", NT3150.workpiece_datum, _length))
    return machine, AxisLimits(_five([low for low, _ in ends]), _five([high for _, high in ends]))


def _mapping(value: object, name: str, keys: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(value, dict) or not set(value) <= set(keys):
        shown = sorted(map(str, set(value) - set(keys))) if isinstance(value, dict) else value
        raise ValueError(f"{name} has {shown!r}, expected a mapping with keys of {', '.join(keys)}")
    return value


def _axis(value: object, name: str, default: RotaryAxis) -> RotaryAxis:
    values = _mapping(value, name, ("direction", "point"))
    return RotaryAxis(_vector(values, "direction", default.direction, _number, name),
                      _vector(values, "point", default.point, _length, name))


def _vector(
    values: dict[str, Any], key: str, default: Vector, read: Callable[[object, str], float], prefix: str = ""
) -> Vector:
    if key not in values:
        return default
    name, found = f"{prefix}.{key}".lstrip("."), values[key]
    if not isinstance(found, list) or len(found) != 3:
        raise ValueError(f"{name} is {found!r}, expected a list of three")
    x, y, z = (read(item, name) for item in found)
    return x, y, z


def _stroke(value: object, name: str) -> tuple[float, float]:
    if value is None:
        return float("-inf"), float("inf")
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"strokes.{name} is {value!r}, expected a list of two, or null")
    unit = "m" if name in "xyz" else "rad"
    return parse_quantity(value[0], unit, f"strokes.{name}"), parse_quantity(value[1], unit, f"strokes.{name}")


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name} has {value!r}, expected numbers")
    return float(value)


def _length(value: object, name: str) -> float:
    return parse_quantity(value, "m", name)


def _five(values: list[float]) -> Five:
    x, y, z, b, c = values
    return x, y, z, b, c
