"""ROS parameters: declared with description and range, from the core's configuration values where there are any."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node


def declare(
    node: Node, name: str, default: Any, description: str, *,
    low: float | None = None, high: float | None = None, read_only: bool = True,
) -> Any:
    """Declare a parameter and return its value, which a launch argument may have set.

    description: with the unit; low, high: bounds of a number; read_only: settable at start only. A number given
    without decimal point for a floating point parameter is taken as one.
    """
    descriptor = ParameterDescriptor(description=description, read_only=read_only)
    if isinstance(default, float):
        descriptor.floating_point_range = _range(FloatingPointRange, low, high, float, math.inf)
        given = node._parameter_overrides.get(name)
        if given is not None and isinstance(given.value, int) and not isinstance(given.value, bool):
            node._parameter_overrides[name] = type(given)(name, value=float(given.value))
    elif isinstance(default, int) and not isinstance(default, bool):
        descriptor.integer_range = _range(IntegerRange, low, high, int, 2**31 - 1)
    return node.declare_parameter(name, default, descriptor).value


def _range(kind: Any, low: float | None, high: float | None, number: Any, infinite: float) -> list[Any]:
    if low is None and high is None:
        return []
    lower, upper = (-infinite if low is None else low), (infinite if high is None else high)
    return [kind(from_value=number(lower), to_value=number(upper))]


def declare_config(
    node: Node, config: Any, ranges: Mapping[str, tuple[float, float]], skip: Collection[str] = (),
) -> dict[str, Any]:
    """Declare a parameter for each field of a configuration value; returns the fields that were set to something else.

    ranges: field -> (low, high); skip: fields that are no parameters. Descriptions come from the docstring of the
    value's class. Only numbers, truth values and texts become parameters; the value checks itself, so a ValueError
    names what does not fit.
    """
    told = descriptions(type(config))
    changed = {}
    for field in fields(config):
        value = getattr(config, field.name)
        if field.name not in skip and isinstance(value, bool | int | float | str):
            low, high = ranges.get(field.name, (None, None))
            chosen = declare(node, field.name, value, told[field.name], low=low, high=high)
            if chosen != value:
                changed[field.name] = chosen
    replace(config, **changed)
    return changed


def descriptions(cls: type) -> dict[str, str]:
    """Meaning of each field of a frozen value, from its class docstring ("name, name [unit]: meaning; name: ...")."""
    text = " ".join((inspect.getdoc(cls) or "").split())
    return {field.name: _description(text, field.name) for field in fields(cls)}  # type: ignore[arg-type]


def _description(text: str, name: str) -> str:
    found = re.search(rf"\b{re.escape(name)}\b[^:;.]*:?\s*([^;]*?)(?=;|\.\s|\.$|$)", text)
    if found is None:
        return name.replace("_", " ")
    return found.group(0).strip()
