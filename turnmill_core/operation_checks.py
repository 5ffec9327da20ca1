"""Checks of the values of an operation: each names field, value, unit and bound."""

from __future__ import annotations

import math


def require(ok: bool, name: str, value: object, unit: str, bound: str) -> None:
    """Raise ``ValueError`` naming field, value, unit and bound unless `ok`."""
    if not ok:
        shown = f"{value!r} {unit}".rstrip()
        raise ValueError(f"{name} is {shown}, expected {bound}")


def finite(name: str, value: float, unit: str) -> None:
    """Refuse a `value` [unit] that is not finite."""
    require(math.isfinite(value), name, value, unit, "a finite number")


def positive(name: str, value: float, unit: str) -> None:
    """Refuse a `value` [unit] that is not finite and > 0."""
    require(math.isfinite(value) and value > 0, name, value, unit, "a finite number > 0")


def not_negative(name: str, value: float, unit: str) -> None:
    """Refuse a `value` [unit] that is not finite and >= 0."""
    require(math.isfinite(value) and value >= 0, name, value, unit, "a finite number >= 0")
