"""The structure's response to the force channels, and the map over one principal period."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]

REASSOCIATE = {"reassoc", "contract"}
OWN = -2
"""In place of an element: the past is the channel's own present value of an earlier period."""


@njit(cache=True)
def moments(
    lam: complex, h: float, n: int, ell: Floats, points: Floats, weights: Floats, nodes: Floats, propagated: Complexes,
    final: Complexes,
) -> None:
    """Response of one mode to unit Lagrange polynomials of the force in an element of duration h.

    propagated (n, n): integral over (0, t_i) of exp(lam (t_i - s)) l_j(s) ds; final (n,): up to the end. points,
    weights ((n + 1) p,): quadrature between neighbouring nodes; ell ((n + 1) p, n): l_j there.
    """
    z = lam * h
    p = points.size // (n + 1)
    total = np.zeros(n, dtype=np.complex128)
    for i in range(n + 1):
        for q in range(i * p, (i + 1) * p):
            factor = np.exp(-z * points[q]) * (weights[q] * h)
            for j in range(n):
                total[j] += factor * ell[q, j]
        if i < n:
            forward = np.exp(z * nodes[i])
            for j in range(n):
                propagated[i, j] = forward * total[j]
    forward = np.exp(z)
    for j in range(n):
        final[j] = forward * total[j]


@njit(cache=True)
def element_operators(
    lam: Complexes, Ct: Complexes, Bt: Complexes, h: float, n: int, ell: Floats, points: Floats, weights: Floats,
    nodes: Floats, b: Floats, index: Ints, F: Floats, K: Floats, R: Floats,
) -> None:
    """Operators of one cut element with channels that push with b (H, 3) at nodes index (H,).

    lam (nb,), Ct (q, nb), Bt (nb, 3): structure in modal blocks. Fills F (q n, 2 nb): contact values at the nodes
    from the modal state at the start; K (q n, H): from the channels; R (2 nb, H): modal state at the end from them.
    """
    nb, rows, H = lam.size, Ct.shape[0], index.size
    propagated, final = np.empty((n, n), dtype=np.complex128), np.empty(n, dtype=np.complex128)
    re, im = np.empty(H), np.empty(H)
    for k in range(nb):
        moments(lam[k], h, n, ell, points, weights, nodes, propagated, final)
        for c in range(H):
            push = Bt[k, 0] * b[c, 0] + Bt[k, 1] * b[c, 1] + Bt[k, 2] * b[c, 2]
            re[c], im[c] = push.real, push.imag
            end = final[index[c]] * push
            R[2 * k, c], R[2 * k + 1, c] = end.real, end.imag
        for i in range(n):
            forward = np.exp(lam[k] * h * nodes[i])
            for a in range(rows):
                if Ct[a, k].real == 0.0 and Ct[a, k].imag == 0.0:
                    continue
                free = Ct[a, k] * forward
                F[a * n + i, 2 * k], F[a * n + i, 2 * k + 1] = free.real, -free.imag
                for c in range(H):
                    g = Ct[a, k] * propagated[i, index[c]]
                    K[a * n + i, c] += g.real * re[c] - g.imag * im[c]


@njit(cache=True)
def interpolation_row(s: float, n: int, support: Floats, bary: Floats) -> Floats:
    """Weights (n + 2,) of the values at `support` (n + 2,) for the value at s, barycentric."""
    row = np.zeros(n + 2)
    total = 0.0
    for i in range(n + 2):
        d = s - support[i]
        if abs(d) < 1e-14:
            for j in range(n + 2):
                row[j] = 0.0
            row[i] = 1.0
            return row
        row[i] = bary[i] / d
        total += row[i]
    for i in range(n + 2):
        row[i] /= total
    return row


@njit(cache=True)
def slots_of(angle: Floats, delay: Floats, period: float, first: int) -> tuple[Ints, Floats]:
    """Slots (H + 1,) of the channels' past values in the state, and the angle (H,) at which each value is seen.

    The angle is negative for a channel without a past.
    """
    H = angle.size
    slot, seen = np.empty(H + 1, dtype=np.int64), np.empty(H)
    slot[0] = first
    for h in range(H):
        m = 0
        seen[h] = -1.0
        if delay[h] >= 0:
            m = max(0, int(np.ceil((delay[h] - angle[h]) / period - 1e-9)))
            seen[h] = max(0.0, angle[h] - delay[h] + m * period)
        slot[h + 1] = slot[h] + m
    return slot, seen


@njit(cache=True)
def operators(
    lam: Complexes, Ct: Complexes, Bt: Complexes, omega: float, edges: Floats, nodes: Ints, element: Ints, node: Ints,
    now: Floats, b: Floats, tab_nodes: Floats, tab_points: Floats, tab_weights: Floats, tab_ell: Floats,
) -> tuple[Complexes, Floats, Floats, Floats, Floats, Floats, Ints]:
    """Operators of all elements, padded: turn (E, nb), F (E, q n, 2 nb), K (E, q n, H), R (E, 2 nb, H).

    Then, for the channels' own now . y, free (E, H, 2 nb) from the modal state at the start and own (E, H, H) from the
    channels. The last value, first (E + 1,), says that the channels of element e are first[e] to first[e + 1].
    """
    nb, rows, E = lam.size, Ct.shape[0], nodes.size
    first = np.zeros(E + 1, dtype=np.int64)
    for h in range(element.size):
        first[element[h] + 1] += 1
    wide, most = 0, 0
    for e in range(E):
        wide, most = max(wide, first[e + 1]), max(most, nodes[e])
    for e in range(E):
        first[e + 1] += first[e]
    turn = np.empty((E, nb), dtype=np.complex128)
    F, K = np.zeros((E, rows * most, 2 * nb)), np.zeros((E, rows * most, wide))
    R, own, free = np.zeros((E, 2 * nb, wide)), np.zeros((E, wide, wide)), np.zeros((E, wide, 2 * nb))
    per_gap = tab_points.shape[1] // tab_nodes.shape[1]
    for e in range(E):
        duration = (edges[e + 1] - edges[e]) / omega
        for k in range(nb):
            turn[e, k] = np.exp(lam[k] * duration)
        n, h0, h1 = nodes[e], first[e], first[e + 1]
        if n == 0:
            continue
        q = per_gap * (n + 1)
        element_operators(lam, Ct, Bt, duration, n, tab_ell[n], tab_points[n, :q], tab_weights[n, :q], tab_nodes[n],
                          b[h0:h1], node[h0:h1], F[e], K[e], R[e])
        for i in range(h1 - h0):
            for a in range(rows):
                weight = now[h0 + i, a]
                row = a * n + node[h0 + i]
                if weight != 0.0:
                    for j in range(h1 - h0):
                        own[e, i, j] += weight * K[e, row, j]
                    for k in range(2 * nb):
                        free[e, i, k] += weight * F[e, row, k]
    return turn, F, K, R, free, own, first


@njit(cache=True)
def sightings(
    seen: Floats, weight: Floats, edges: Floats, nodes: Ints, omega: float, lam: Complexes, Ct: Complexes,
    support: Floats, bary: Floats,
) -> tuple[Ints, Floats]:
    """Element (S,) in which each value weight (S, q) . y at angle `seen` is seen, and its row on what is known there.

    Rows (S, width) act on the modal state at the element's start in free flight, and on the contact values (n + 2, q)
    at start, nodes and end of a cut element. Element -1 for a negative angle.
    """
    S, rows, nb = seen.size, Ct.shape[0], lam.size
    most = 0
    for n in nodes:
        most = max(most, n)
    at, found = np.zeros(S, dtype=np.int64), np.zeros((S, max(2 * nb, (most + 2) * rows)))
    for s in range(S):
        at[s] = -1
        if seen[s] < 0:
            continue
        e = 0
        while e < nodes.size - 1 and seen[s] >= edges[e + 1]:
            e += 1
        at[s] = e
        n = nodes[e]
        if n == 0:
            for k in range(nb):
                forward = np.exp(lam[k] * ((seen[s] - edges[e]) / omega))
                for a in range(rows):
                    g = weight[s, a] * Ct[a, k] * forward
                    found[s, 2 * k] += g.real
                    found[s, 2 * k + 1] -= g.imag
            continue
        row = interpolation_row((seen[s] - edges[e]) / (edges[e + 1] - edges[e]), n, support[n], bary[n])
        for i in range(n + 2):
            for a in range(rows):
                found[s, i * rows + a] = row[i] * weight[s, a]
    return at, found


@njit(cache=True)
def mark_own(at: Ints, seen: Floats, angle: Floats, now: Floats, past: Floats) -> None:
    """Set at[h] to OWN for every channel whose past is its own present value of an earlier period, in place."""
    for h in range(at.size):
        same = at[h] >= 0 and abs(seen[h] - angle[h]) < 1e-12
        for a in range(now.shape[1]):
            same = same and now[h, a] == past[h, a]
        if same:
            at[h] = OWN


@njit(cache=True)
def looked_into(at: Ints, seen_at: Ints, E: int) -> Ints:
    """1 for each element (E,) of which the contact values are wanted between its channels."""
    wanted = np.zeros(E, dtype=np.int64)
    for e in at:
        if e >= 0:
            wanted[e] = 1
    for e in seen_at:
        wanted[e] = 1
    return wanted


@njit(cache=True)
def factorise(A: Floats, pivot: Ints) -> None:
    """LU factors of A (n, n) in place, n = pivot.size, row pivoting."""
    n = pivot.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivot[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            A[i, k] = f
            if f != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= f * A[k, j]


@njit(cache=True, fastmath=REASSOCIATE)
def substitute(A: Floats, pivot: Ints, x: Floats) -> None:
    """Solve with the factors of :func:`factorise`; the first n of x are replaced."""
    n = pivot.size
    for k in range(n):
        x[k], x[pivot[k]] = x[pivot[k]], x[k]
    for k in range(n):
        total = x[k]
        for j in range(k):
            total -= A[k, j] * x[j]
        x[k] = total
    for k in range(n - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, n):
            total -= A[k, j] * x[j]
        x[k] = total / A[k, k]


@njit(cache=True)
def factors(scale: float, own: Floats, first: Ints, LU: Floats, pivot: Ints) -> None:
    """Factors LU (E, H, H), pivot (E, H) of 1 - scale own for every element."""
    for e in range(own.shape[0]):
        w = first[e + 1] - first[e]
        for i in range(w):
            for j in range(w):
                LU[e, i, j] = (1.0 if i == j else 0.0) - scale * own[e, i, j]
        factorise(LU[e], pivot[e, :w])


@njit(cache=True, fastmath=REASSOCIATE)
def inner(u: Floats, v: Floats, n: int) -> float:
    """Sum of u[i] v[i], i < n."""
    total = 0.0
    for i in range(n):
        total += u[i] * v[i]
    return total


@njit(cache=True)
def read_contact(Ct: Complexes, X: Floats, out: Floats) -> None:
    """Contact values out (q,) of the modal state X (2 nb,)."""
    for a in range(Ct.shape[0]):
        out[a] = 0.0
        for k in range(Ct.shape[1]):
            out[a] += Ct[a, k].real * X[2 * k] - Ct[a, k].imag * X[2 * k + 1]


@njit(cache=True)
def apply_period(
    x: Floats, out: Floats, scale: float, Ct: Complexes, nodes: Ints, slot: Ints, turn: Complexes, F: Floats, K: Floats,
    R: Floats, free: Floats, LU: Floats, pivot: Ints, first: Ints, at: Ints, rows: Floats, seen_at: Ints,
    seen_rows: Floats, wanted: Ints, shown: Floats,
) -> None:
    """out (L,): the state x (L,) one principal period later; shown (P,): the probes' values on the way.

    scale: factor on all forces. LU, pivot: factors of 1 - scale own. at, rows: sightings of the channels' pasts;
    seen_at, seen_rows: of the probes; wanted: looked_into.
    """
    q, nb, E, H = Ct.shape[0], Ct.shape[1], nodes.size, at.size
    X = x[:2 * nb].copy()
    before = np.empty(2 * nb)
    inside = np.zeros(H)
    for h in range(H):
        for s in range(slot[h], slot[h + 1] - 1):
            out[s] = x[s + 1]
    y = np.empty((F.shape[1] // q + 2) * q)
    chip = np.empty(K.shape[2])
    for e in range(E):
        n, h0, h1 = nodes[e], first[e], first[e + 1]
        known, width = before, 2 * nb
        if n > 0:
            for h in range(h0, h1):
                met = x[slot[h]] if slot[h + 1] > slot[h] else inside[h]
                chip[h - h0] = inner(free[e, h - h0], X, 2 * nb) - met
            substitute(LU[e], pivot[e, :h1 - h0], chip)
            for h in range(h0, h1):
                if at[h] == OWN:  # now . y is the chip thickness and what was met
                    out[slot[h + 1] - 1] = chip[h - h0] + x[slot[h]]
            if wanted[e] == 1:
                for i in range(n):
                    for a in range(q):
                        y[(i + 1) * q + a] = inner(F[e, a * n + i], X, 2 * nb) + scale * inner(
                            K[e, a * n + i], chip, h1 - h0)
                read_contact(Ct, X, y[:q])
            known, width = y, (n + 2) * q
        else:
            for k in range(2 * nb):
                before[k] = X[k]
        for k in range(nb):
            re, im, w = X[2 * k], X[2 * k + 1], turn[e, k]
            X[2 * k] = w.real * re - w.imag * im
            X[2 * k + 1] = w.real * im + w.imag * re
        if n > 0:
            for k in range(2 * nb):
                X[k] += scale * inner(R[e, k], chip, h1 - h0)
            if wanted[e] == 1:
                read_contact(Ct, X, y[(n + 1) * q:(n + 2) * q])
        if wanted[e] == 0:
            continue
        for h in range(H):
            if at[h] == e:
                value = inner(rows[h], known, width)
                if slot[h + 1] > slot[h]:
                    out[slot[h + 1] - 1] = value
                else:
                    inside[h] = value
        for s in range(seen_at.size):
            if seen_at[s] == e:
                shown[s] = inner(seen_rows[s], known, width)
    for k in range(2 * nb):
        out[k] = X[k]


@njit(cache=True)
def dense_map(
    L: int, Ct: Complexes, nodes: Ints, slot: Ints, turn: Complexes, F: Floats, K: Floats, R: Floats, free: Floats,
    LU: Floats, pivot: Ints, first: Ints, at: Ints, rows: Floats, seen_at: Ints, seen_rows: Floats, wanted: Ints,
) -> tuple[Floats, Floats]:
    """Matrix (L, L) over one period and the probes' values (P, L); the other arguments as in apply_period."""
    columns, shown, x = np.zeros((L, L)), np.zeros((L, seen_at.size)), np.zeros(L)
    for j in range(L):
        x[j] = 1.0
        apply_period(x, columns[j], 1.0, Ct, nodes, slot, turn, F, K, R, free, LU, pivot, first, at, rows, seen_at,
                     seen_rows, wanted, shown[j])
        x[j] = 0.0
    return columns.T.copy(), shown.T.copy()
