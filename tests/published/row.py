"""One published number beside the computed one."""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """A line of the validation table.

    published: the printed number, or words where there is none ("figure only"); computed: what this
    project gives, in the same unit; why: the reason for a difference, or how the number was read.
    """

    quantity: str
    source: str
    published: float | str
    computed: float
    unit: str
    why: str
