"""The cut over one principal period: elements, nodes and force channels."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TWO_PI = 2 * np.pi
MOST_NODES = 24
"""Nodes of an element at most; a longer element is divided."""


@njit(cache=True)
def tooth_matrix(
    tip: float, lag: float, height: Floats, start: Floats, stop: Floats, Ktc: float, Krc: float, Kac: float,
    out: Floats,
) -> None:
    """Add the directional matrix of one tooth with its tip at `tip` to out (3, 2); see problem.directional_matrix."""
    tip = tip % TWO_PI
    n = height.size
    for arc in range(start.shape[1]):
        low, high = cut_range(lag, height, start, stop, arc)
        if high <= low:
            continue
        for turn in range(int(np.floor(low / TWO_PI)), int(np.floor(high / TWO_PI)) + 1):
            phi = tip + turn * TWO_PI
            if phi < low or phi > high:
                continue
            bottom, top = -1.0, -1.0  # engaged heights that touch are integrated together
            for i in range(n - 1):
                z0, z1 = height[i], height[i + 1]
                l1, r1 = start[i, arc] + lag * z0 - phi, start[i + 1, arc] + lag * z1 - phi
                l2, r2 = phi - stop[i, arc] - lag * z0, phi - stop[i + 1, arc] - lag * z1
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
                from_z, to_z = z0 + a * (z1 - z0), z0 + b * (z1 - z0)
                if bottom >= 0 and a == 0.0 and top == z0:
                    top = to_z
                else:
                    if bottom >= 0:
                        _add_strip(phi, lag, bottom, top, Ktc, Krc, Kac, out)
                    bottom, top = from_z, to_z
                if b == 1.0:
                    top = z1
            if bottom >= 0:
                _add_strip(phi, lag, bottom, top, Ktc, Krc, Kac, out)


@njit(cache=True)
def _add_strip(
    phi: float, lag: float, bottom: float, top: float, Ktc: float, Krc: float, Kac: float, out: Floats,
) -> None:
    """Add the integral of (-Krc n + Ktc t - Kac e_z) n^T over heights bottom to top of an edge with tip angle phi."""
    length = top - bottom
    middle = phi - lag * 0.5 * (top + bottom)
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
def cut_range(lag: float, height: Floats, start: Floats, stop: Floats, arc: int) -> tuple[float, float]:
    """Lowest and highest tip angle at which a tooth cuts within one arc; low > high for an empty arc."""
    low, high, cuts = 1e300, -1e300, False
    for i in range(height.size):
        low = min(low, start[i, arc] + lag * height[i])
        high = max(high, stop[i, arc] + lag * height[i])
        cuts = cuts or stop[i, arc] > start[i, arc]
    return (low, high) if cuts else (1.0, 0.0)


@njit(cache=True)
def teeth_in_cut(
    angle: float, offsets: Floats, lag: float, height: Floats, start: Floats, stop: Floats, found: Ints,
) -> int:
    """Mark in found (teeth,) how many arcs hold the tip angle `angle` + offset of each tooth; returns their sum."""
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
def break_angles(
    period: float, offsets: Floats, lag: float, height: Floats, start: Floats, stop: Floats, shift: float,
) -> Floats:
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
                    angle = start[0, arc] if kind == 2 else start[last, arc] + lag * height[last]
                else:
                    angle = stop[0, arc] if kind == 4 else stop[last, arc] + lag * height[last]
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
def layout(
    period: float, offsets: Floats, lag: float, height: Floats, start: Floats, stop: Floats, shift: float, lead: float,
    rate: float, base_nodes: float, longest: float,
) -> tuple[Floats, Ints, float]:
    """Elements of one principal period: edges (E + 1,) from the origin, nodes (E,), 0 in free flight, the origin.

    lead: angle of free flight wanted before the first cut. rate: oscillation [1] of the structure per rad of tool
    rotation. base_nodes: nodes of an element in which nothing oscillates. longest: longest element [rad].
    """
    breaks = break_angles(period, offsets, lag, height, start, stop, shift)
    E = breaks.size
    found = np.empty(offsets.size, dtype=np.int64)
    widths, cuts = np.empty(E), np.empty(E, dtype=np.bool_)
    first, free = 0, -1.0
    for e in range(E):
        widths[e] = (breaks[e + 1] if e + 1 < E else breaks[0] + period) - breaks[e]
        cuts[e] = teeth_in_cut(breaks[e] + 0.5 * widths[e], offsets, lag, height, start, stop, found) > 0
        if not cuts[e] and widths[e] > free:
            first, free = (e + 1) % E, widths[e]
    origin = breaks[first]
    most = 2 + E * (2 + int(np.ceil((rate + 2.0) * period / 10.0 + period / longest)))
    edges, nodes = np.zeros(most + 1), np.zeros(most, dtype=np.int64)
    at, before = 0, 0.0
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
            count = MOST_NODES + 1
            while count > MOST_NODES:
                wave = (rate + 2.0) * width / pieces
                count = max(2, int(np.ceil(base_nodes + min(3.0, 1.5 * wave) + 0.56 * wave)))
                if count > MOST_NODES:
                    pieces += 1
        for _ in range(pieces):
            edges[at + 1] = edges[at] + width / pieces
            nodes[at] = count
            at += 1
    return edges[:at + 1].copy(), nodes[:at].copy(), origin


@njit(cache=True)
def channels(
    edges: Floats, nodes: Ints, origin: float, table: Floats, offsets: Floats, delays: Floats, variation: float,
    joined: bool, rotating: bool, omega: float, damping: float, friction: float, basis: Floats, lag: float,
    height: Floats, start: Floats, stop: Floats, Ktc: float, Krc: float, Kac: float,
) -> tuple[Ints, Ints, Floats, Floats, Floats, Floats, Floats]:
    """Force channels of every cut element.

    delays (teeth,): delay times tool speed [rad]. joined: all teeth share one delay and are added. rotating:
    contact and force are in the frame that turns with the tool at omega [rad/s]. damping [N s/m2], friction [1]:
    process damping per depth. With y the contact displacement, and below it the velocity where there is process
    damping, the force is b (now . y(t) - past . y(t - delay)). Returns element, node, angle from the origin, delay
    angle (negative: no past), now and past (H, q) and b (H, 3).
    """
    r = basis.shape[1]
    q = r if damping == 0.0 else 2 * r
    each = (2 if rotating else r) + (0 if damping == 0.0 else 2)
    most = 0
    for n in nodes:
        most += n * each * offsets.size
    element, node = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    angle, delay = np.empty(most), np.empty(most)
    now, past, b = np.zeros((most, q)), np.zeros((most, q)), np.zeros((most, 3))
    found = np.empty(offsets.size, dtype=np.int64)
    G, P, turn = np.empty((3, 2)), np.empty((3, 2)), np.eye(2)
    H = 0
    for e in range(nodes.size):
        n = nodes[e]
        if n == 0:
            continue
        teeth_in_cut(origin + 0.5 * (edges[e] + edges[e + 1]), offsets, lag, height, start, stop, found)
        for i in range(n):
            local = edges[e] + (edges[e + 1] - edges[e]) * table[n, i]
            if rotating:
                s, c = np.sin(origin + local), np.cos(origin + local)
                turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = c, s, -s, c
            for j in range(1 if joined else offsets.size):
                G.fill(0.0)
                P.fill(0.0)
                cutting, tooth = 0, j
                for t in range(offsets.size):
                    if found[t] > 0 and (joined or t == j):
                        tip = origin + local + offsets[t]
                        tooth_matrix(tip, lag, height, start, stop, Ktc, Krc, Kac, G)
                        if damping != 0.0:
                            tooth_matrix(tip, lag, height, start, stop, friction * damping, damping, 0.0, P)
                        cutting += 1
                        tooth = t
                if cutting == 0:
                    continue
                phi = origin + local + offsets[tooth]
                late = delays[j] * (1 - variation * np.cos(phi - 0.5 * lag * height[-1]))
                one = lag == 0.0 and cutting == 1 and (r == 2 or rotating)
                for kind in range(1 if damping == 0.0 else 2):
                    for a in range(1 if one else (2 if rotating else r)):
                        if one:
                            ux, uy = np.sin(phi), np.cos(phi)
                        elif rotating:
                            ux, uy = turn[0, a], turn[1, a]
                        else:
                            ux, uy = basis[0, a], basis[1, a]
                        f = G if kind == 0 else P
                        fx, fy = f[0, 0] * ux + f[0, 1] * uy, f[1, 0] * ux + f[1, 1] * uy
                        b[H, 2] = f[2, 0] * ux + f[2, 1] * uy
                        # from the fixed into the turning frame, where the past is turned by the tool's motion since
                        b[H, 0], b[H, 1] = turn[0, 0] * fx + turn[1, 0] * fy, turn[0, 1] * fx + turn[1, 1] * fy
                        vx, vy = turn[0, 0] * ux + turn[1, 0] * uy, turn[0, 1] * ux + turn[1, 1] * uy
                        s, c = (np.sin(late), np.cos(late)) if rotating else (0.0, 1.0)
                        for k in range(r):
                            if kind == 0:
                                now[H, k] = basis[0, k] * vx + basis[1, k] * vy
                                past[H, k] = basis[0, k] * (c * vx + s * vy) + basis[1, k] * (c * vy - s * vx)
                            else:
                                now[H, r + k] = basis[0, k] * vx + basis[1, k] * vy
                                if rotating:
                                    now[H, k] = omega * (basis[1, k] * vx - basis[0, k] * vy)
                        element[H], node[H], angle[H], delay[H] = e, i, local, late if kind == 0 else -1.0
                        H += 1
    return element[:H], node[:H], angle[:H], delay[:H], now[:H], past[:H], b[:H]
