"""Steady vibration without its transient: the periodic orbit of the linear map (Eq. 4.127), and its fast estimate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from turnmill_core.process.linear import LinearMap, MapState, advance, at_rest
from turnmill_core.process.vibration import Vibration, vibration

Floats = NDArray[np.float64]

RESIDUAL = 1e-11
"""Largest misfit of the orbit after one period, as a share of its size."""
KRYLOV = 250
REFINEMENTS = 6


def orbit_state(step_map: LinearMap) -> MapState:
    """State that returns to itself after one period: s = Phi s + e, solved by GMRES on (I - Phi) s = e.

    Phi, the transition matrix over the period (Eq. 4.106), is applied by marching and never formed. The orbit exists
    below and above the stability limit. Raises ``ValueError`` where a multiplier is 1 to within rounding, so that it
    does not.
    """
    rest = at_rest(step_map)
    n, size = rest.x.size, rest.x.size + rest.past.size
    scale = _scales(step_map)

    def over_period(s: Floats, forced: bool) -> Floats:
        start = MapState(s[:n] * scale, s[n:].reshape(-1, 2))
        after = advance(step_map, start, step_map.steps, forced)[0]
        return np.concatenate([after.x / scale, after.past.ravel()])

    operator = LinearOperator((size, size), matvec=lambda s: s - over_period(s.ravel(), False))
    found = np.zeros(size)
    for _ in range(REFINEMENTS):
        misfit = over_period(found, True) - found
        if np.linalg.norm(misfit) <= RESIDUAL * np.linalg.norm(found):
            break
        found = found + gmres(operator, misfit, rtol=1e-8, atol=0.0, restart=min(size, KRYLOV), maxiter=4)[0]
    else:
        raise ValueError("the steady vibration was not found, expected a cut whose Floquet multipliers are not 1")
    return MapState(found[:n] * scale, found[n:].reshape(-1, 2))


def _scales(step_map: LinearMap) -> Floats:
    """Units of the states that make displacement and velocity of every mode count alike."""
    model = step_map.cut.modes.modes
    size = np.maximum(np.linalg.norm(model.shapes, axis=0), 1e-12)
    return np.concatenate([1 / size, 2 * np.pi * model.frequency / size])


def periodic_orbit(step_map: LinearMap, revolution: bool = True) -> Vibration:
    """Steady vibration over one period of the map, or over the tool revolution that it is a part of."""
    repeats = round(2 * np.pi / (step_map.cut.problem.tool_speed * step_map.cut.period)) if revolution else 1
    _, states, contact = advance(step_map, orbit_state(step_map), repeats * step_map.steps)
    return vibration(step_map, states, contact)
