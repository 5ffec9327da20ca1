"""A chuck from the receptances of a dummy workpiece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Operation
from turnmill_core.operation_structure import Chuck
from turnmill_core.structure.beam import free_bar
from turnmill_core.structure.profile import stock_profile
from turnmill_core.structure.receptance import chuck_from_dummy, chuck_receptance, fit_chuck, seated_receptances
from turnmill_ros.errors import InputError
from turnmill_ros.frf_file import FrfFile

PAIRS = ("11", "12", "22")


@dataclass(frozen=True, eq=False)
class IdentifiedChuck:
    """A chuck in one plane.

    frequency (k,) [Hz]; receptance, fitted (k, 2, 2): of displacement [m] and rotation [rad] for force [N] and moment
    [N m], exact and of the fit; chuck: the fit; error: root mean square deviation of the dummy's receptance 11.
    """

    frequency: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    fitted: NDArray[np.complex128]
    chuck: Chuck
    error: float

    def parts(self) -> list[tuple[str, NDArray[np.complex128]]]:
        """Name and values (k,) of the three different receptances."""
        return [("displacement for force [m/N]", self.receptance[:, 0, 0]),
                ("rotation for force [rad/N]", self.receptance[:, 1, 0]),
                ("rotation for moment [rad/(N m)]", self.receptance[:, 1, 1])]


def identify_chuck(
    op: Operation, frfs: FrfFile, points: tuple[float, float], band: tuple[float, float] | None = None,
) -> IdentifiedChuck:
    """The chuck that holds the operation's bar.

    frfs: receptances 11, 12 and 22; points [m]: 1 and 2, from the free end; band [Hz]: frequencies that are used.
    Raises InputError where a receptance is missing.
    """
    beam = op.workpiece.beam
    assert beam is not None
    missing = [pair for pair in PAIRS if pair not in frfs.pairs]
    if missing:
        raise InputError("a receptance of the dummy is missing", value=missing, expected="columns for 11, 12 and 22")
    keep = np.ones(frfs.frequency.size, dtype=bool) if band is None else (
        (frfs.frequency >= band[0]) & (frfs.frequency <= band[1]))
    if keep.sum() < 16:
        raise InputError("band", value=band, expected="at least 16 frequencies")
    f = frfs.frequency[keep]
    bar = free_bar(stock_profile(op.workpiece), beam.material, beam.shear)
    H = {pair: frfs.receptance[frfs.pairs.index(pair)][keep] for pair in PAIRS}
    measured = H["11"], H["12"], H["22"]
    base = chuck_from_dummy(bar, points, f, *measured)
    chuck = fit_chuck(bar, points, f, *measured)
    fitted = chuck_receptance(chuck, f)
    again = seated_receptances(bar, bar.row(points[0]), fitted, f)[:, 0, 0]
    error = float(np.linalg.norm(again - H["11"]) / np.linalg.norm(H["11"]))
    return IdentifiedChuck(f, base, fitted, chuck, error)
