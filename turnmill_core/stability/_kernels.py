"""Compiled loops of the collocation solver; each is tested against its plain version.

See :mod:`turnmill_core.stability.collocation` for the method and the meaning of the arrays. Angles are
tool rotation in rad; local element coordinates run from 0 to 1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

TWO_PI = 2 * np.pi


@njit(cache=True)
def tooth_matrix(tip, lag, height, start, stop, Ktc, Krc, Kac, out):
    """Add the directional matrix of one tooth with its tip at `tip` to out (3, 2); see problem.directional_matrix."""
    tip = tip % TWO_PI
    n = height.size
    for arc in range(start.shape[1]):
        low, high, any_cut = 1e300, -1e300, False
        for i in range(n):
            low = min(low, start[i, arc] + lag * height[i])
            high = max(high, stop[i, arc] + lag * height[i])
            any_cut = any_cut or stop[i, arc] > start[i, arc]
        if not any_cut:
            continue
        for turn in range(int(np.floor(low / TWO_PI)), int(np.floor(high / TWO_PI)) + 1):
            phi = tip + turn * TWO_PI
            if phi < low or phi > high:
                continue
            for i in range(n - 1):
                z0, span = height[i], height[i + 1] - height[i]
                l1, r1 = start[i, arc] + lag * z0 - phi, start[i + 1, arc] + lag * height[i + 1] - phi
                l2, r2 = phi - stop[i, arc] - lag * z0, phi - stop[i + 1, arc] - lag * height[i + 1]
                if (l1 > 0 and r1 > 0) or (l2 > 0 and r2 > 0):
                    continue
                a, b = 0.0, 1.0
                if l1 > 0:
                    a = l1 / (l1 - r1)
                elif r1 > 0:
                    b = l1 / (l1 - r1)
                if l2 > 0:
                    a = max(a, l2 / (l2 - r2))
                elif r2 > 0:
                    b = min(b, l2 / (l2 - r2))
                if b <= a:
                    continue
                length = (b - a) * span
                middle = phi - lag * (z0 + 0.5 * (a + b) * span)
                x = 0.5 * lag * length
                single = length * (np.sin(x) / x if abs(x) > 1e-9 else 1.0)
                double = single * np.cos(x)
                s, c = np.sin(middle), np.cos(middle)
                s2, c2 = double * 2 * s * c, double * (c * c - s * s)
                out[0, 0] -= 0.5 * (Krc * (length - c2) + Ktc * s2)
                out[0, 1] -= 0.5 * (Krc * s2 + Ktc * (length + c2))
                out[1, 0] -= 0.5 * (Krc * s2 - Ktc * (length - c2))
                out[1, 1] -= 0.5 * (Krc * (length + c2) - Ktc * s2)
                out[2, 0] -= Kac * single * s
                out[2, 1] -= Kac * single * c


@njit(cache=True)
def moments(lam, h, n, ell, points, weights, nodes, propagated, final):
    """Response of one mode to unit Lagrange polynomials of the force in an element of duration h.

    propagated (n, n) complex: integral over (0, t_i) of exp(lam (t_i - s)) l_j(s) ds; final (n,): up to the end.
    points, weights ((n+1) p,): quadrature between neighbouring nodes; ell ((n+1) p, n): l_j there.
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
def element_operators(lam, Ct, Bt, h, n, ell, points, weights, nodes, b, index):
    """Operators of one cut element with channels that push with b (H, 3) at nodes index (H,).

    lam (nb,), Ct (r, nb), Bt (nb, 3): structure in modal blocks. Returns F (r n, 2 nb): contact displacement at
    the nodes from the modal state at the start; K (r n, H): from the channels; R (2 nb, H): modal state at the
    end from the channels.
    """
    nb, r, H = lam.size, Ct.shape[0], index.size
    F = np.zeros((r * n, 2 * nb))
    K = np.zeros((r * n, H))
    R = np.zeros((2 * nb, H))
    propagated = np.empty((n, n), dtype=np.complex128)
    final = np.empty(n, dtype=np.complex128)
    push = np.empty(H, dtype=np.complex128)
    for k in range(nb):
        moments(lam[k], h, n, ell, points, weights, nodes, propagated, final)
        for c in range(H):
            push[c] = Bt[k, 0] * b[c, 0] + Bt[k, 1] * b[c, 1] + Bt[k, 2] * b[c, 2]
            end = final[index[c]] * push[c]
            R[2 * k, c], R[2 * k + 1, c] = end.real, end.imag
        for a in range(r):
            out = Ct[a, k]
            for i in range(n):
                free = out * np.exp(lam[k] * h * nodes[i])
                F[a * n + i, 2 * k], F[a * n + i, 2 * k + 1] = free.real, -free.imag
                for c in range(H):
                    g = propagated[i, index[c]]
                    re, im = out.real * g.real - out.imag * g.imag, out.real * g.imag + out.imag * g.real
                    K[a * n + i, c] += re * push[c].real - im * push[c].imag
    return F, K, R


@njit(cache=True)
def advance(X, lam, h):
    """Free flight of the modal state X (2 nb, m) over the duration h, in place."""
    for k in range(lam.size):
        e = np.exp(lam[k] * h)
        for j in range(X.shape[1]):
            re, im = X[2 * k, j], X[2 * k + 1, j]
            X[2 * k, j] = e.real * re - e.imag * im
            X[2 * k + 1, j] = e.real * im + e.imag * re


@njit(cache=True)
def contact(X, lam, Ct, out):
    """Contact displacement out (r, m) of the modal state X (2 nb, m)."""
    out.fill(0.0)
    for k in range(lam.size):
        for a in range(Ct.shape[0]):
            g = Ct[a, k]
            for j in range(X.shape[1]):
                out[a, j] += g.real * X[2 * k, j] - g.imag * X[2 * k + 1, j]


@njit(cache=True)
def interpolation_row(s, n, support, bary):
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
def cut_range(lag, height, start, stop, arc):
    """Lowest and highest tip angle at which a tooth cuts within one arc; low > high for an empty arc."""
    low, high, cuts = 1e300, -1e300, False
    for i in range(height.size):
        low = min(low, start[i, arc] + lag * height[i])
        high = max(high, stop[i, arc] + lag * height[i])
        cuts = cuts or stop[i, arc] > start[i, arc]
    return (low, high) if cuts else (1.0, 0.0)


@njit(cache=True)
def teeth_in_cut(angle, offsets, lag, height, start, stop, found):
    """Mark in found (teeth,) how many arcs of each tooth hold tip angle `angle` + offset; returns their sum."""
    total = 0
    for j in range(offsets.size):
        found[j] = 0
        for arc in range(start.shape[1]):
            low, high = cut_range(lag, height, start, stop, arc)
            if high > low:
                found[j] += int(np.floor((high - angle - offsets[j]) / TWO_PI)) - int(
                    np.ceil((low - angle - offsets[j]) / TWO_PI)) + 1
        total += found[j]
    return total


@njit(cache=True)
def break_angles(period, offsets, lag, height, start, stop, shift):
    """Angles in [0, period), ascending, where the force of some tooth is not smooth.

    These are the passes of the edge's lower and upper end through entry and exit. shift: where it is not 0, the
    same angles delayed by it, at which the surface left by the preceding tooth is not smooth.
    """
    last = height.size - 1
    found = np.empty(12 * offsets.size * start.shape[1] + 1)
    count = 0
    for j in range(offsets.size):
        for arc in range(start.shape[1]):
            low, high = cut_range(lag, height, start, stop, arc)
            if high <= low:
                continue
            for kind in range(6):
                if kind == 0:
                    angle = low
                elif kind == 1:
                    angle = high
                elif kind < 4:
                    angle = (start[0, arc] if kind == 2 else start[last, arc] + lag * height[last])
                else:
                    angle = (stop[0, arc] if kind == 4 else stop[last, arc] + lag * height[last])
                for late in range(2 if shift != 0.0 else 1):
                    value = (angle - offsets[j] + late * shift) % period
                    at = count
                    while at > 0 and found[at - 1] > value:
                        found[at] = found[at - 1]
                        at -= 1
                    found[at] = value
                    count += 1
    if count == 0:
        return np.zeros(1)
    keep = 1
    for i in range(1, count):
        if found[i] - found[keep - 1] > 1e-6 and found[i] - found[0] < period - 1e-6:
            found[keep] = found[i]
            keep += 1
    return found[:keep].copy()


@njit(cache=True)
def layout(period, offsets, lag, height, start, stop, shift, lead, rate, base_nodes, longest):
    """Elements of one principal period: edges (E + 1,) from the origin, nodes per element (E,), 0 in free flight, origin.

    lead: angle of free flight wanted before the first cut. rate: oscillation [1] of the structure per rad of tool
    rotation. base_nodes: nodes of an element in which nothing oscillates. longest: longest element [rad].
    """
    breaks = break_angles(period, offsets, lag, height, start, stop, shift)
    E = breaks.size
    found = np.empty(offsets.size, dtype=np.int64)
    widths = np.empty(E)
    cuts = np.empty(E, dtype=np.bool_)
    first, free = 0, -1.0
    for e in range(E):
        widths[e] = (breaks[e + 1] if e + 1 < E else breaks[0] + period) - breaks[e]
        cuts[e] = teeth_in_cut(breaks[e] + 0.5 * widths[e], offsets, lag, height, start, stop, found) > 0
        if not cuts[e] and widths[e] > free:
            first, free = (e + 1) % E, widths[e]
    origin = breaks[first]
    most = 2 + E * (2 + int(np.ceil((rate + 2.0) * period / 10.0 + period / longest)))
    edges, nodes = np.zeros(most + 1), np.zeros(most, dtype=np.int64)
    at = 0
    before = 0.0
    if free > 0 and lead > 0:
        before = min(lead, 0.999 * free)
        origin -= before
        edges[1] = before
        at = 1
    for k in range(E):
        e = (first + k) % E
        width = widths[e] - (before if k == E - 1 else 0.0)
        pieces, count = 1, 0
        if cuts[e]:
            pieces = max(1, int(np.ceil(width / longest)))
            count = 25
            while count > 24:
                wave = (rate + 2.0) * width / pieces
                count = int(np.ceil(base_nodes + min(3.0, 1.5 * wave) + 0.62 * wave))
                if count > 24:
                    pieces += 1
        for i in range(pieces):
            edges[at + 1] = edges[at] + width / pieces
            nodes[at] = count
            at += 1
    return edges[:at + 1].copy(), nodes[:at].copy(), origin


@njit(cache=True)
def channels(edges, nodes, origin, period, tables, offsets, delays, variation, joined, basis, lag, height, start, stop,
             Ktc, Krc, Kac):
    """Force channels of every cut element.

    delays (teeth,): delay times tool speed [rad]. joined: all teeth share one delay and are added. Returns element,
    node, angle from the origin, delay angle, c (H, r) and b (H, 3): the force is b (c . y now - c . y then).
    """
    r = basis.shape[1]
    most = 0
    for n in nodes:
        most += n * r * offsets.size
    element = np.empty(most, dtype=np.int64)
    node = np.empty(most, dtype=np.int64)
    angle, delay = np.empty(most), np.empty(most)
    c, b = np.zeros((most, r)), np.zeros((most, 3))
    found = np.empty(offsets.size, dtype=np.int64)
    G = np.empty((3, 2))
    H = 0
    for e in range(nodes.size):
        n = nodes[e]
        if n == 0:
            continue
        middle = origin + 0.5 * (edges[e] + edges[e + 1])
        teeth_in_cut(middle, offsets, lag, height, start, stop, found)
        for i in range(n):
            local = edges[e] + (edges[e + 1] - edges[e]) * tables[n, i]
            for j in range(1 if joined else offsets.size):
                G.fill(0.0)
                cutting, tooth = 0, j
                for t in range(offsets.size):
                    if found[t] > 0 and (joined or t == j):
                        tooth_matrix(origin + local + offsets[t], lag, height, start, stop, Ktc, Krc, Kac, G)
                        cutting += 1
                        tooth = t
                if cutting == 0:
                    continue
                phi = origin + local + offsets[tooth]
                late = delays[j] * (1 - variation * np.cos(phi - 0.5 * lag * height[-1]))
                rank_one = r == 2 and lag == 0.0 and cutting == 1
                for a in range(1 if rank_one else r):
                    if rank_one:
                        ux, uy = np.sin(phi), np.cos(phi)
                    else:
                        ux, uy = basis[0, a], basis[1, a]
                    for i3 in range(3):
                        b[H, i3] = G[i3, 0] * ux + G[i3, 1] * uy
                    for a2 in range(r):
                        c[H, a2] = basis[0, a2] * ux + basis[1, a2] * uy
                    element[H], node[H], angle[H], delay[H] = e, i, local, late
                    H += 1
    return element[:H], node[:H], angle[:H], delay[:H], c[:H], b[:H]


@njit(cache=True)
def add_product(A, B, scale, out):
    """out += scale * A @ B."""
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            f = scale * A[i, k]
            if f != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += f * B[k, j]


@njit(cache=True)
def solve_in_place(A, B):
    """Replace B (n, m) by the solution of A X = B, Gaussian elimination with row pivoting; A is overwritten."""
    n, m = A.shape[0], B.shape[1]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            for j in range(m):
                B[k, j], B[best, j] = B[best, j], B[k, j]
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= f * A[k, j]
                for j in range(m):
                    B[i, j] -= f * B[k, j]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            f = A[k, i]
            if f != 0.0:
                for j in range(m):
                    B[k, j] -= f * B[i, j]
        f = 1.0 / A[k, k]
        for j in range(m):
            B[k, j] *= f


@njit(cache=True)
def add_observed(weight, angle, edges, nodes, e, omega, lam, Ct, X, Y, support, bary, out):
    """Add weight (r,) . y at `angle` within element e to out (m,); X: state at its start, Y (n + 2, r, m): cut element."""
    m = out.size
    if nodes[e] == 0:
        for k in range(lam.size):
            forward = np.exp(lam[k] * ((angle - edges[e]) / omega))
            for a in range(weight.size):
                g = weight[a] * Ct[a, k] * forward
                for j in range(m):
                    out[j] += g.real * X[2 * k, j] - g.imag * X[2 * k + 1, j]
        return
    n = nodes[e]
    row = interpolation_row((angle - edges[e]) / (edges[e + 1] - edges[e]), n, support[n], bary[n])
    for i in range(n + 2):
        for a in range(weight.size):
            f = row[i] * weight[a]
            if f != 0.0:
                for j in range(m):
                    out[j] += f * Y[i, a, j]


@njit(cache=True)
def element_at(angle, edges):
    """Index of the element that holds `angle`."""
    e = 0
    while e < edges.size - 2 and angle >= edges[e + 1]:
        e += 1
    return e


@njit(cache=True)
def cut_element(scale, X, F, K, R, lam, Ct, duration, node, c, past, n, Y):
    """Carry the state X (2 nb, m) through a cut element; past (H, m): what the channels meet; fills Y (n + 2, r, m)."""
    H, m, r = node.size, X.shape[1], Ct.shape[0]
    free = np.zeros((F.shape[0], m))
    add_product(F, X, 1.0, free)
    system, chip = np.zeros((H, H)), np.zeros((H, m))
    for i in range(H):
        system[i, i] = 1.0
        for j in range(m):
            chip[i, j] = -past[i, j]
        for a in range(r):
            ca, row = c[i, a], a * n + node[i]
            for j in range(m):
                chip[i, j] += ca * free[row, j]
            for j in range(H):
                system[i, j] -= scale * ca * K[row, j]
    solve_in_place(system, chip)
    add_product(K, chip, scale, free)
    contact(X, lam, Ct, Y[0])
    advance(X, lam, duration)
    add_product(R, chip, scale, X)
    contact(X, lam, Ct, Y[n + 1])
    for a in range(r):
        for i in range(n):
            for j in range(m):
                Y[i + 1, a, j] = free[a * n + i, j]


@njit(cache=True)
def slots_of(angle, delay, period, first):
    """Slots (H + 1,) of the channels' past values in the state, and the angle (H,) at which each value is seen."""
    H = angle.size
    slot, seen = np.empty(H + 1, dtype=np.int64), np.empty(H)
    slot[0] = first
    for h in range(H):
        m = max(0, int(np.ceil((delay[h] - angle[h]) / period - 1e-9)))
        seen[h] = max(0.0, angle[h] - delay[h] + m * period)
        slot[h + 1] = slot[h] + m
    return slot, seen


@njit(cache=True)
def period_matrices(scales, lam, Ct, Bt, omega, period, edges, nodes, element, node, angle, delay, c, b, probes,
                    tab_nodes, tab_points, tab_weights, tab_ell, support, bary):
    """Matrices (S, L, L) over one period for forces multiplied by `scales` (S,), and displacement at `probes`.

    State: modal state (2 nb,), then for each channel c . y at the times before the period's start at which it is
    needed, oldest first. Returns the matrices and (S, probes, r, L).
    """
    nb, r, H, E = lam.size, Ct.shape[0], element.size, nodes.size
    slot, seen = slots_of(angle, delay, period, 2 * nb)
    L = slot[H]
    first = np.zeros(E + 1, dtype=np.int64)
    for h in range(H):
        first[element[h] + 1] += 1
    for e in range(E):
        first[e + 1] += first[e]
    per_gap = tab_points.shape[1] // tab_nodes.shape[1]
    F, K, R = [np.zeros((1, 1))], [np.zeros((1, 1))], [np.zeros((1, 1))]
    for e in range(E):
        n, h0, h1 = nodes[e], first[e], first[e + 1]
        if n > 0:
            q = per_gap * (n + 1)
            f, k, g = element_operators(lam, Ct, Bt, (edges[e + 1] - edges[e]) / omega, n, tab_ell[n], tab_points[n, :q],
                                        tab_weights[n, :q], tab_nodes[n], b[h0:h1], node[h0:h1])
            F.append(f)
            K.append(k)
            R.append(g)
    matrices = np.zeros((scales.size, L, L))
    shown = np.zeros((scales.size, probes.size, r, L))
    inside = np.zeros((H, L))
    unit = np.eye(r)
    for s in range(scales.size):
        M = matrices[s]
        X = np.zeros((2 * nb, L))
        start = np.zeros((2 * nb, L))
        for k in range(2 * nb):
            X[k, k] = 1.0
        for h in range(H):
            for q in range(slot[h], slot[h + 1] - 1):
                M[q, q + 1] = 1.0
        cut = 0
        for e in range(E):
            n, h0, h1 = nodes[e], first[e], first[e + 1]
            duration = (edges[e + 1] - edges[e]) / omega
            Y = np.zeros((n + 2, r, L))
            for i in range(2 * nb):
                for j in range(L):
                    start[i, j] = X[i, j]
            if n == 0:
                advance(X, lam, duration)
            else:
                cut += 1
                past = inside[h0:h1]
                for h in range(h0, h1):
                    if slot[h + 1] > slot[h]:
                        past[h - h0, slot[h]] = 1.0
                cut_element(scales[s], X, F[cut], K[cut], R[cut], lam, Ct, duration, node[h0:h1], c[h0:h1], past, n, Y)
                past.fill(0.0)
            for h in range(H):
                if element_at(seen[h], edges) == e:
                    target = M[slot[h + 1] - 1] if slot[h + 1] > slot[h] else inside[h]
                    add_observed(c[h], seen[h], edges, nodes, e, omega, lam, Ct, start, Y, support, bary, target)
            for k in range(probes.size):
                if element_at(probes[k], edges) == e:
                    for a in range(r):
                        add_observed(unit[a], probes[k], edges, nodes, e, omega, lam, Ct, start, Y, support, bary,
                                     shown[s, k, a])
        for i in range(2 * nb):
            for j in range(L):
                M[i, j] = X[i, j]
    return matrices, shown
