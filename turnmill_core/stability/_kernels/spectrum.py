"""The multiplier of largest magnitude, without forming the map: Arnoldi's method carried from depth to depth."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from turnmill_core.stability._kernels.cut import channels, layout
from turnmill_core.stability._kernels.operators import (
    apply_period,
    factors,
    inner,
    looked_into,
    mark_own,
    operators,
    sightings,
    slots_of,
)

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MOST_STEPS = 40
"""Dimension of the Krylov space at most."""


@njit(cache=True)
def largest_eigenvalue(H: Floats) -> complex:
    """Eigenvalue of largest magnitude, Im >= 0, of an upper Hessenberg matrix: Francis' double-shift QR iteration.

    Raises ``ValueError`` where an eigenvalue does not settle in 60 steps.
    """
    A = H.copy()
    top = A.shape[0] - 1
    best, norm, moved = 0.0 + 0.0j, 0.0, 0.0
    for i in range(top + 1):
        for j in range(max(i - 1, 0), top + 1):
            norm += abs(A[i, j])
    steps = 0
    while top >= 0:
        low = top
        while low > 0:
            size = abs(A[low - 1, low - 1]) + abs(A[low, low])
            if abs(A[low, low - 1]) <= 1e-15 * (size if size > 0 else norm):
                A[low, low - 1] = 0.0
                break
            low -= 1
        x = A[top, top]
        if low == top:
            if abs(x + moved) > abs(best):
                best = complex(x + moved, 0.0)
            top -= 1
            steps = 0
            continue
        y, w = A[top - 1, top - 1], A[top, top - 1] * A[top - 1, top]
        if low == top - 1:
            half = 0.5 * (y - x)
            inside = half * half + w
            root = np.sqrt(abs(inside))
            if inside >= 0:
                z = half + (root if half >= 0 else -root)
                one, two = x + moved + z, x + moved - (w / z if z != 0.0 else 0.0)
                if abs(one) > abs(best):
                    best = complex(one, 0.0)
                if abs(two) > abs(best):
                    best = complex(two, 0.0)
            elif abs(complex(x + moved + half, root)) > abs(best):
                best = complex(x + moved + half, root)
            top -= 2
            steps = 0
            continue
        if steps == 60:
            raise ValueError("an eigenvalue of the Krylov matrix does not settle")
        if steps % 10 == 9:
            moved += x
            for i in range(top + 1):
                A[i, i] -= x
            size = abs(A[top, top - 1]) + abs(A[top - 1, top - 2])
            x = y = 0.75 * size
            w = -0.4375 * size * size
        steps += 1
        m = top - 2
        p, q, r = 0.0, 0.0, 0.0
        while m >= low:
            z = A[m, m]
            u, v = x - z, y - z
            p = (u * v - w) / A[m + 1, m] + A[m, m + 1]
            q = A[m + 1, m + 1] - z - u - v
            r = A[m + 2, m + 1]
            size = abs(p) + abs(q) + abs(r)
            p, q, r = p / size, q / size, r / size
            if m == low:
                break
            if abs(A[m, m - 1]) * (abs(q) + abs(r)) <= 1e-16 * abs(p) * (
                    abs(A[m - 1, m - 1]) + abs(z) + abs(A[m + 1, m + 1])):
                break
            m -= 1
        for i in range(m + 2, top + 1):
            A[i, i - 2] = 0.0
            if i > m + 2:
                A[i, i - 3] = 0.0
        for k in range(m, top):
            size = 0.0
            if k > m:
                p, q = A[k, k - 1], A[k + 1, k - 1]
                r = A[k + 2, k - 1] if k < top - 1 else 0.0
                size = abs(p) + abs(q) + abs(r)
                if size == 0.0:
                    continue
                p, q, r = p / size, q / size, r / size
            s = np.sqrt(p * p + q * q + r * r)
            s = s if p >= 0 else -s
            if s == 0.0:
                continue
            if k > m:
                A[k, k - 1] = -s * size
            elif low != m:
                A[k, k - 1] = -A[k, k - 1]
            p += s
            xx, yy, zz = p / s, q / s, r / s
            q, r = q / p, r / p
            for j in range(k, top + 1):
                t = A[k, j] + q * A[k + 1, j]
                if k < top - 1:
                    t += r * A[k + 2, j]
                    A[k + 2, j] -= t * zz
                A[k + 1, j] -= t * yy
                A[k, j] -= t * xx
            for i in range(low, min(top, k + 3) + 1):
                t = xx * A[i, k] + yy * A[i, k + 1]
                if k < top - 1:
                    t += zz * A[i, k + 2]
                    A[i, k + 2] -= t * r
                A[i, k + 1] -= t * q
                A[i, k] -= t
    return best


@njit(cache=True)
def ritz_vector(H: Floats, m: int, value: complex) -> Complexes:
    """Unit eigenvector (m,) of the Hessenberg matrix H (m, m) for `value`, by substitution from its last component."""
    y = np.zeros(m, dtype=np.complex128)
    y[m - 1] = 1.0
    for k in range(m - 1, 0, -1):
        total = -value * y[k]
        for j in range(k, m):
            total += H[k, j] * y[j]
        below = H[k, k - 1]
        y[k - 1] = -total / (below if abs(below) > 1e-300 else 1e-300)
        if abs(y[k - 1]) > 1e100:
            largest = abs(y[k - 1])
            for j in range(k - 1, m):
                y[j] /= largest
    size = 0.0
    for k in range(m):
        size += abs(y[k]) ** 2
    size = 1.0 / np.sqrt(size)
    for k in range(m):
        y[k] *= size
    return y


@njit(cache=True)
def column(
    lam: Complexes, Ct: Complexes, Bt: Complexes, basis: Floats, omega: float, period: float, offsets: Floats,
    delays: Floats, variation: Floats, shift: float, joined: bool, rotating: bool, damping: float, friction: float,
    lag: float, heights: Floats, starts: Floats, stops: Floats, Ktc: float, Krc: float, Kac: float, proportional: bool,
    base_nodes: float, stiffening: float, tab_nodes: Floats, tab_points: Floats, tab_weights: Floats, tab_ell: Floats,
    support: Floats, bary: Floats, tolerance: float, multipliers: Complexes, residuals: Floats,
) -> None:
    """Leading multipliers (S,) at one tool speed for engagements heights (S, k), starts, stops (S, k, arcs).

    omega: tool speed [rad/s]. delays (teeth,): mean delay times tool speed [rad]. variation (S,). shift [rad]: by how
    much the delay differs from the tooth period. proportional: all engagements differ by a factor of the depth only
    and the edge is straight, so that the first serves all. stiffening [1/(s2 m)]: how much a depth may stiffen a mode.
    The first Krylov vector holds the previous depth's solution; residuals (S,): what is left of each multiplier.
    """
    S = heights.shape[0]
    none, nothing = np.empty(0), np.empty((0, Ct.shape[0]))
    fastest, early, late, deepest = 0.0, delays[0], 0.0, 0.0
    for k in range(lam.size):
        fastest = max(fastest, abs(lam[k]))
    for j in range(delays.size):
        early, late = min(early, delays[j]), max(late, delays[j])
    for s in range(S):
        deepest = max(deepest, heights[s, -1])
    carried = np.zeros(1)
    covered = 0.0
    for s in range(S):
        if heights[s, -1] > covered:
            depth = heights[s, -1]
            covered = min(deepest, max(1.5 * depth, 0.1 * deepest)) if proportional else depth
            rate = np.sqrt(fastest ** 2 + stiffening * covered) / omega
            split = shift % period if abs(shift) > 0.02 and abs(lag) * depth < 0.1 else 0.0
            edges, nodes, origin = layout(
                period, offsets, lag, heights[s], starts[s], stops[s], split,
                1.001 * max(0.0, late * (1 + variation[s]) - period), rate, base_nodes,
                0.9 * early * (1 - variation[s]))
            element, node, angle, delay, now, past, b = channels(
                edges, nodes, origin, tab_nodes, offsets, delays, variation[s], joined, rotating, omega, damping,
                friction, basis, lag, heights[s], starts[s], stops[s], Ktc, Krc, Kac)
            slot, seen = slots_of(angle, delay, period, 2 * lam.size)
            turn, F, K, R, free, own, first = operators(
                lam, Ct, Bt, omega, edges, nodes, element, node, now, b, tab_nodes, tab_points, tab_weights, tab_ell)
            at, rows = sightings(seen, past, edges, nodes, omega, lam, Ct, support, bary)
            mark_own(at, seen, angle, now, past)
            seen_at, seen_rows = sightings(none, nothing, edges, nodes, omega, lam, Ct, support, bary)
            wanted = looked_into(at, seen_at, nodes.size)
            LU, pivot = np.empty_like(own), np.empty((own.shape[0], own.shape[1]), dtype=np.int64)
        if not proportional:
            covered = 0.0
        scale = heights[s, -1] / depth
        factors(scale, own, first, LU, pivot)
        L = slot[-1]
        V, H, z = np.zeros((MOST_STEPS + 1, L)), np.zeros((MOST_STEPS + 1, MOST_STEPS)), np.zeros(L)
        for i in range(L):
            V[0, i] = 0.02 * np.sin(1.0 + 12.9898 * i * (s + 1)) / np.sqrt(0.5 * L)
            if carried.size == L:
                V[0, i] += carried[i]
        size = np.sqrt(inner(V[0], V[0], L))
        for i in range(L):
            V[0, i] /= size
        value, residual = 0.0 + 0.0j, 1.0
        check, decay, step = min(5, L), 1.5, 1
        for m in range(1, min(MOST_STEPS, L) + 1):
            apply_period(V[m - 1], z, scale, Ct, nodes, slot, turn, F, K, R, free, LU, pivot, first, at, rows, seen_at,
                         seen_rows, wanted, none)
            size = np.sqrt(inner(z, z, L))
            for again in range(2):
                for k in range(m):
                    f = inner(V[k], z, L)
                    H[k, m - 1] += f
                    for i in range(L):
                        z[i] -= f * V[k, i]
                H[m, m - 1] = np.sqrt(inner(z, z, L))
                if again == 0 and H[m, m - 1] > 0.1 * size:
                    break
            closed = m == min(MOST_STEPS, L) or H[m, m - 1] < 1e-13 * abs(H[0, 0])
            for i in range(L):
                V[m, i] = z[i] / max(H[m, m - 1], 1e-300)
            if closed or m == check:
                value, before = largest_eigenvalue(H[:m, :m]), residual
                y = ritz_vector(H, m, value)
                residual = 0.0 if m == L else abs(y[m - 1]) * H[m, m - 1]
                if m > 5 and 0.0 < residual < before:  # the next check is where the residual should be small enough
                    decay = min(max(np.log(before / residual) / step, 0.3), 3.0)
                left = np.log(max(residual, 1e-300) / (tolerance * max(1.0, abs(value))))
                step = min(max(int(np.ceil(left / decay)), 1), 5)
                check = m + step
                if closed or residual < tolerance * max(1.0, abs(value)):
                    carried = np.zeros(L)
                    for k in range(m):
                        for i in range(L):
                            carried[i] += (y[k].real + y[k].imag) * V[k, i]
                    break
        multipliers[s], residuals[s] = value, residual
