"""Modes that depend on where the machine stands or how fast the spindle turns (thesis 4.2, 4.3.7.1).

Modes measured at several places are followed from place to place: each is paired with the one most like it in shape
(MAC) and frequency, so that two whose frequencies cross keep their names. Between the places frequency, damping, mass
and shape are linear along every axis; outside the measured places the nearest values hold.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from turnmill_core.operation_structure import Mode, ModeTable, Structure
from turnmill_core.structure.modal import Floats

_FREQUENCY = 3.0
"""Weight of |ln(f1/f2)| against 1 - MAC: a mode of another direction is as unlike as one 40 % away in frequency."""


def shape_vector(mode: Mode) -> Floats:
    """All components of a mode's shape in one vector."""
    return np.array([s for shape in (mode.shape, *mode.above) for s in shape] + [mode.torsion])


def mac(first: Mode, second: Mode) -> float:
    """Modal assurance criterion of two shapes: 1 for the same direction, 0 for perpendicular ones."""
    a, b = shape_vector(first), shape_vector(second)
    return float((a @ b) ** 2 / ((a @ a) * (b @ b)))


def matched(reference: tuple[Mode, ...], modes: tuple[Mode, ...]) -> tuple[Mode, ...]:
    """`modes` in the order of the most similar ones in `reference` (both of the same length)."""
    cost = [[1 - mac(a, b) + _FREQUENCY * abs(np.log(a.frequency / b.frequency)) for b in modes] for a in reference]
    return tuple(modes[k] for k in linear_sum_assignment(np.array(cost))[1])


@lru_cache(maxsize=32)
def followed(table: ModeTable) -> ModeTable:
    """The table on its grid in ascending order, each mode at the same index everywhere.

    The modes are followed from the first entry outwards, each place from its nearest neighbour that is done.
    """
    values = table.values()
    given = {tuple(v.index(x) for v, x in zip(values, place, strict=True)): modes
             for place, modes in zip(table.places, table.modes, strict=True)}
    first = next(iter(given))
    done = {first: given[first]}
    for index in sorted(given, key=lambda i: sum(abs(a - b) for a, b in zip(i, first, strict=True))):
        if index not in done:
            near = min(done, key=lambda i: sum(abs(a - b) for a, b in zip(i, index, strict=True)))
            done[index] = matched(done[near], given[index])
    order = sorted(done)
    places = tuple(tuple(v[k] for v, k in zip(values, index, strict=True)) for index in order)
    return ModeTable(table.axes, places, tuple(done[index] for index in order))


def modes_at_place(table: ModeTable, place: dict[str, float]) -> tuple[Mode, ...]:
    """Interpolated modes where the axes of the table have the values of `place` [m, rad, rad/s]."""
    grid = followed(table)
    corners: list[list[tuple[int, float]]] = []
    for name, values in zip(grid.axes, grid.values(), strict=True):
        x = float(np.clip(place[name], values[0], values[-1]))
        k = min(max(int(np.searchsorted(values, x)) - 1, 0), max(len(values) - 2, 0))
        share = (x - values[k]) / (values[k + 1] - values[k]) if len(values) > 1 else 0.0
        corners.append([(k, 1 - share), (k + 1, share)])
    lengths = [len(v) for v in grid.values()]
    weighted = [(grid.modes[int(np.ravel_multi_index([c[0] for c in corner], lengths))],
                 float(np.prod([c[1] for c in corner])))
                for corner in product(*corners) if all(c[1] > 0 for c in corner)]
    return tuple(_mean([(modes[i], share) for modes, share in weighted]) for i in range(len(grid.modes[0])))


def _mean(parts: list[tuple[Mode, float]]) -> Mode:
    if len(parts) == 1:
        return parts[0][0]
    lead = shape_vector(parts[0][0])
    shape = sum(share * np.copysign(1.0, lead @ shape_vector(mode)) * shape_vector(mode) for mode, share in parts)
    frequency, damping, mass, phase = (
        sum(share * value for share, value in zip([s for _, s in parts], column, strict=True))
        for column in zip(*((m.frequency, m.damping, m.mass, m.phase) for m, _ in parts), strict=True))
    vectors = [(float(x), float(y), float(z)) for x, y, z in np.asarray(shape)[:-1].reshape(-1, 3)]
    return Mode(frequency, damping, mass, vectors[0], float(np.asarray(shape)[-1]), tuple(vectors[1:]), phase)


def structure_at_place(structure: Structure, place: dict[str, float]) -> Structure:
    """The structure with the modes that its table gives at `place`; as it is where it has none."""
    if structure.table is None:
        return structure
    return Structure(modes_at_place(structure.table, place), structure.frame, structure.heights, structure.cross_modes,
                     structure.cross_reading, structure.coriolis, structure.turning_damping)
