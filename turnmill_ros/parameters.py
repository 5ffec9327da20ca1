"""ROS parameters: declared with description and range, from the core's configuration values where there are any."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

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


class Setting(NamedTuple):
    """What a parameter means, with its unit, and its bounds (None: none)."""

    description: str
    low: float | None = None
    high: float | None = None


def declare_config(node: Node, config: Any, settings: Mapping[str, Setting]) -> dict[str, Any]:
    """Declare parameters for fields of a configuration value; returns the fields that were set to something else.

    config: its values are the defaults; settings: field -> what it means. A pair of numbers becomes an array. The
    value checks itself, so a ValueError names what does not fit.
    """
    changed = {}
    for name, (description, low, high) in settings.items():
        default = getattr(config, name)
        kept = list(default) if isinstance(default, tuple) else default
        chosen = declare(node, name, kept, description, low=low, high=high)
        if isinstance(default, tuple):
            chosen = tuple(chosen)
        if chosen != default:
            changed[name] = chosen
    replace(config, **changed)
    return changed
