"""Loads along the cutting edges of a steady cut: by tooth and by place on the edge."""

from __future__ import annotations

from turnmill_core.cutting.along_path import has_closed_form
from turnmill_core.cutting.chip import ChipModel, prepare_cut
from turnmill_core.cutting.forces import EdgeLoads, edge_loads
from turnmill_core.cutting.loads import part_of
from turnmill_core.cutting.steady import steady_map
from turnmill_core.operation import Conditions, Operation


def distribution(
    op: Operation, conditions: Conditions, angles: int = 360, elements: int = 48, chip: ChipModel = "static"
) -> EdgeLoads | None:
    """Loads of the edges around the tool (bottom edges left out) over one revolution, None without contact.

    Added over teeth and elements they are the forces of loads.cutting_loads.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        angles: number of angles.
        elements: number of elements of the edges.
        chip: `static` or `exact`, this only where the engagement has a closed form.

    Raises:
        ValueError: a depth beyond the flute length, or an exact chip where there is none.
    """
    if not conditions.in_cut:
        return None
    if has_closed_form(op):
        cut = prepare_cut(op, conditions, elements)
    else:
        found = steady_map(op, conditions, elements)
        if not found.in_cut:
            return None
        cut = part_of(op, found, ~found.elements.bottom)
    return edge_loads(op.material, cut, angles, chip) if cut.engagement.angle.any() else None
