"""Compiled evidence of trial speeds: do lines lie whole steps apart?"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def lattice_evidence(frequency: Floats, spread: Floats, step: float, ratios: Floats, alone: float,
                     comb: bool, reach: float) -> Floats:
    """Log-likelihood of lines (n,), strongest first, on lattices of each trial ratio (m,) times a step.

    frequency, spread (n,): of the lines and their standard deviations, and step, in Hz. comb: whether the
    first lattice is that of the step's multiples, or none is known before the first line. A line joins the lattice on
    which it is most probable: the probability of each grows with its members, and the density about its places is that
    of a Gaussian; or it founds a lattice of its own and the mirrored one, with probability `alone` and anywhere. A line
    is up to `reach` steps from the founder (mirrored, as frequencies are positive). All densities are over that of a
    line anywhere.
    """
    found = np.zeros(len(ratios))
    places, members, width = np.zeros((3, 2 * len(frequency) + 1))
    for m in range(len(ratios)):
        spacing = ratios[m] * step
        count, total = 1, 1.0 if comb else 0.0
        members[0] = total
        for k in range(len(frequency)):
            order = frequency[k] / spacing
            best, joined = math.log(alone), -1
            for j in range(count):
                if j == 0 and (order < 0.5 or not comb):
                    continue
                away = order - places[j]
                if j > 0 and away > reach:
                    continue
                sigma = math.hypot(spread[k], width[j])
                away = abs(away - np.rint(away)) * spacing / sigma
                if away < 5.0:
                    share = (1.0 - alone) * members[j] / total
                    gain = math.log(share * spacing / (sigma * math.sqrt(2.0 * math.pi))) - 0.5 * away * away
                    if gain > best:
                        best, joined = gain, j
            found[m] += best
            total += 1.0
            if joined >= 0:
                members[joined] += 1.0
            else:
                for sign in (1.0, -1.0):
                    places[count], members[count], width[count] = sign * order, 0.5, spread[k]
                    count += 1
    return found
