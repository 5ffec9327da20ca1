"""Compiled march of the linear map from step to step."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def march(
    P: Floats, Q0: Floats, Q1: Floats, E: Floats, lag: Floats, C: Floats, forced: bool, states: Floats,
    contact: Floats,
) -> None:
    """States and contact displacements of successive steps, in place.

    P (k, n, n), Q0, Q1 (groups, k, n, 2), E (k, n), lag (groups, k) [steps]: see linear.LinearMap; C (2, n).
    forced: add E. states (m + 1, n): the first row is given. contact (b + m + 1, 2): displacement at the contact,
    the first b rows (the past, ending one step before the first state) are given.
    """
    k, n = P.shape[0], P.shape[1]
    back = contact.shape[0] - states.shape[0]
    for i in range(states.shape[0]):
        for c in range(2):
            value = 0.0
            for a in range(n):
                value += C[c, a] * states[i, a]
            contact[back + i, c] = value
        if i + 1 == states.shape[0]:
            break
        at = i % k
        for a in range(n):
            value = E[at, a] if forced else 0.0
            for b in range(n):
                value += P[at, a, b] * states[i, b]
            states[i + 1, a] = value
        for j in range(Q0.shape[0]):
            place = back + i - lag[j, at]
            base = math.floor(place + 1e-9)
            part = place - base
            for c in range(2):
                first = contact[base, c] + part * (contact[base + 1, c] - contact[base, c])
                last = contact[base + 1, c]
                if part > 1e-9:
                    last += part * (contact[base + 2, c] - contact[base + 1, c])
                for a in range(n):
                    states[i + 1, a] += Q0[j, at, a, c] * first + Q1[j, at, a, c] * (last - first)
