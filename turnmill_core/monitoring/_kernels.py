"""Compiled loops of this room, each tested against its plain version (`.py_func`)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@njit(cache=True)
def kalman_comb(x: Floats, turns: Floats, harmonics: int, gain: float) -> Floats:
    """What a comb of tracked harmonics leaves of x (n,): see baselines.kalman_energy_ratios.

    turns (n,): revolutions at the samples. Harmonic k is a rotating complex state, corrected at each sample by 2 gain
    times the innovation; all turn by powers of one rotation a sample.
    """
    real, imag = np.zeros(harmonics), np.zeros(harmonics)
    left = np.empty(len(x))
    for n in range(len(x)):
        turned = 2.0 * np.pi * (turns[n] - turns[n - 1] if n > 0 else 0.0)
        c, s = np.cos(turned), np.sin(turned)
        ck, sk, total = 1.0, 0.0, 0.0
        for k in range(harmonics):
            ck, sk = ck * c - sk * s, ck * s + sk * c
            real[k], imag[k] = real[k] * ck - imag[k] * sk, real[k] * sk + imag[k] * ck
            total += real[k]
        left[n] = x[n] - total
        for k in range(harmonics):
            real[k] += 2.0 * gain * left[n]
    return left


@njit(cache=True)
def resampled(x: Floats, taps: Floats, up: int, down: int) -> Floats:
    """x (n,) at up / down of its rate, zero beyond its ends, through symmetric `taps` (low-pass at the raised rate).

    As scipy.signal.resample_poly, sample 0 on sample 0. The signal is split into its `down` phases, so that the inner
    loops run over neighbours.
    """
    half, per = (len(taps) - 1) // 2, -(-len(x) // down)
    phases = np.zeros((down, per))
    for k in range(len(x)):
        phases[k % down, k // down] = x[k]
    out = np.zeros(-(-len(x) * up // down))
    for p in range(up):
        row = np.zeros(-(-(len(out) - p) // up))
        for t in range(len(taps)):
            at = p * down + half - t
            if at % up == 0:
                first, tap = at // up, up * taps[t]
                source, shift = phases[first % down], first // down
                low, high = max(0, -shift), min(len(row), per - shift)
                target, given = row[low:high], source[low + shift: high + shift]
                for k in range(high - low):
                    target[k] += tap * given[k]
        out[p::up] = row
    return out


POLE = 3.0**0.5 - 2.0


@njit(cache=True)
def spline_coefficients(x: Floats) -> Floats:
    """Coefficients (n,) of the cubic B-spline through samples x (n,), n > 1, mirrored at its ends.

    Two recursions (Unser 1999, Fig. 8); the mirrored sum that starts the first is cut off where it is below rounding.
    """
    count = len(x)
    c = 6.0 * x
    total, power = c[0], POLE
    for k in range(1, 40):
        place = k % (2 * count - 2)
        total += power * c[min(place, 2 * count - 2 - place)]
        power *= POLE
    c[0] = total
    for k in range(1, count):
        c[k] += POLE * c[k - 1]
    c[count - 1] = POLE / (POLE * POLE - 1.0) * (c[count - 1] + POLE * c[count - 2])
    for k in range(count - 2, -1, -1):
        c[k] = POLE * (c[k + 1] - c[k])
    return c


@njit(cache=True)
def spline_at(coefficients: Floats, turns: Floats, start: float, step: float, count: int) -> tuple[Floats, Floats]:
    """Cubic spline and its places at `count` equal angles: start + (k + 1) step revolutions.

    coefficients (n,): of the cubic B-spline through samples (scipy.ndimage.spline_filter1d, mode mirror);
    turns (n,): revolutions at the samples, ascending. Returns the values and the places in samples.
    """
    last = len(turns) - 1
    values, places = np.empty(count), np.empty(count)
    j = 0
    for k in range(count):
        angle = start + (k + 1) * step
        while j < last - 1 and turns[j + 1] < angle:
            j += 1
        place = j + (angle - turns[j]) / (turns[j + 1] - turns[j])
        place = min(max(place, 0.0), float(last))
        i = min(int(place), last)
        t = place - i
        s = 1.0 - t
        a = i - 1 if i > 0 else min(1, last)
        c = i + 1 if i < last else max(last - 1, 0)
        d = i + 2 if i + 2 <= last else max(2 * last - i - 2, 0)
        values[k] = (s * s * s * coefficients[a] + (4.0 - 3.0 * t * t * (1.0 + s)) * coefficients[i]
                     + (4.0 - 3.0 * s * s * (1.0 + t)) * coefficients[c] + t * t * t * coefficients[d]) / 6.0
        places[k] = place
    return values, places


@njit(cache=True)
def row_fits(table: Floats) -> tuple[Floats, Floats]:
    """Mean, slope and bend over the rows of table (n, m): least squares on 1, r and r^2 - mean(r^2), (3, m); and what
    mean and slope give for all rows (n m,).

    r: number of the row, from the middle one.
    """
    count, width = table.shape
    fits, wave = np.zeros((3, width)), np.empty((count, width))
    mean, slope, bend = fits
    mean_square = (count * count - 1) / 12.0
    squares = fourths = 0.0
    for i in range(count):
        r = i - (count - 1) / 2.0
        b = r * r - mean_square
        squares += r * r
        fourths += b * b
        for k in range(width):
            mean[k] += table[i, k]
            slope[k] += r * table[i, k]
            bend[k] += b * table[i, k]
    for k in range(width):
        mean[k] /= count
        slope[k] /= squares
        bend[k] /= fourths
    for i in range(count):
        r = i - (count - 1) / 2.0
        for k in range(width):
            wave[i, k] = mean[k] + r * slope[k]
    return fits, wave.ravel()


@njit(cache=True)
def half_means(table: Floats) -> Floats:
    """Means over the first and the last half of the rows of table (n, m), n > 1: (2, m)."""
    count, width = table.shape
    half = count // 2
    found = np.zeros((2, width))
    for i in range(half):
        for k in range(width):
            found[0, k] += table[i, k] / half
            found[1, k] += table[count - half + i, k] / half
    return found


@njit(cache=True)
def telling_harmonics(mean: Complexes, noise: Floats, last: int, teeth: int, share: float) -> NDArray[np.int64]:
    """Harmonics, multiples of the spindle frequency below `last`, that tell the speed: those of the tooth passing
    frequency, or all where the former hold less than `share` of the energy above the noise, and four or more do,
    none of which holds 60 %.

    mean (m,): amplitudes; noise (m,): mean square that noise alone gives each.
    """
    total = tooth = largest = 0.0
    count = 0
    for h in range(1, last):
        power = mean[h].real ** 2 + mean[h].imag ** 2
        if power >= 20.0 * noise[h]:
            total += power
            largest = max(largest, power)
            tooth += power if h % teeth == 0 else 0.0
            count += 1 if power > 0.0 else 0
    every = count >= 4 and largest < 0.6 * total and tooth < share * total
    return np.arange(1, last) if every else np.arange(teeth, last, teeth)


@njit(cache=True)
def weighted_median(values: Floats, weight: Floats) -> float:
    """The first of the values (n,), ascending, at which half of the weight (n,) is reached."""
    order = np.argsort(values, kind="mergesort")
    passed, half = 0.0, 0.5 * np.sum(weight)
    for k in order:
        passed += weight[k]
        if passed >= half:
            return float(values[k])
    return float(values[order[-1]])


@njit(cache=True)
def phase_drift(mean: Complexes, trend: Complexes, bend: Complexes, harmonics: NDArray[np.int64],
                noise: Floats) -> tuple[float, float]:
    """Turns per revolution, and per revolution squared, by which the phases of harmonics go away from the assumed ones.

    mean, trend, bend (m,): amplitudes, their change per revolution and its change; noise (h,): mean square that
    noise gives each of the harmonics (h,). Weighted medians over those 20 times above it; (0, 0) without any.
    """
    used = np.empty(len(harmonics), dtype=np.int64)
    power = np.empty(len(harmonics))
    n = 0
    for k in range(len(harmonics)):
        h = harmonics[k]
        power[n] = mean[h].real ** 2 + mean[h].imag ** 2
        if power[n] > 20.0 * noise[k]:
            used[n] = h
            n += 1
    if n == 0:
        return 0.0, 0.0
    middle = np.median(power[:n])
    speed, ramp, weight = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        h = used[k]
        scale = 2.0 * np.pi * h * power[k]
        weight[k] = h * min(1.0, math.sqrt(power[k] / middle))
        speed[k] = (mean[h].real * trend[h].imag - mean[h].imag * trend[h].real) / scale
        ramp[k] = (mean[h].real * bend[h].imag - mean[h].imag * bend[h].real) / scale
    return weighted_median(speed, weight), weighted_median(ramp, weight)


@njit(cache=True)
def waves(times: Floats, frequencies: Floats) -> Floats:
    """Cosines, sines, and both times a ramp from -1 to 1: (4 m, n) for m frequencies [Hz] at times (n,) [s].

    At equal steps the angle goes on by one rotation a step.
    """
    m, n = len(frequencies), len(times)
    found = np.empty((4 * m, n))
    step = (times[-1] - times[0]) / max(1, n - 1)
    uneven = 0.0
    for k in range(n):
        uneven = max(uneven, abs(times[k] - times[0] - k * step))
    for i in range(m):
        w = 2.0 * np.pi * frequencies[i]
        c, s = math.cos(w * times[0]), math.sin(w * times[0])
        turn_c, turn_s = math.cos(w * step), math.sin(w * step)
        for k in range(n):
            if w * uneven > 1e-9:
                c, s = math.cos(w * times[k]), math.sin(w * times[k])
            ramp = 2.0 * k / max(1, n - 1) - 1.0
            found[i, k], found[m + i, k] = c, s
            found[2 * m + i, k], found[3 * m + i, k] = c * ramp, s * ramp
            c, s = c * turn_c - s * turn_s, c * turn_s + s * turn_c
    return found


@njit(cache=True)
def dot(a: Floats, b: Floats) -> float:
    """Sum of a b, (n,) each: in eight sums side by side, the same bits on every machine."""
    n = len(a) // 8 * 8
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    for k in range(0, n, 8):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
        s4 += a[k + 4] * b[k + 4]
        s5 += a[k + 5] * b[k + 5]
        s6 += a[k + 6] * b[k + 6]
        s7 += a[k + 7] * b[k + 7]
    total = ((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7))
    for k in range(n, len(a)):
        total += a[k] * b[k]
    return total


@njit(cache=True)
def normal_equations(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Products of columns (m, n) with each other (m, m) and with values (n,): (m,)."""
    count = len(columns)
    gram, right = np.empty((count, count)), np.empty(count)
    for i in range(count):
        right[i] = dot(columns[i], values)
        for j in range(i + 1):
            gram[i, j] = gram[j, i] = dot(columns[i], columns[j])
    return gram, right


@njit(cache=True)
def harmonic_energy(mean: Complexes, trend: Complexes, rows: int, period: int) -> Floats:
    """Mean square (m,) of harmonics with amplitudes mean and trend (m,) a revolution, weights Hann squared.

    rows: number of averaged periods of `period` revolutions. 0 for the constant.
    """
    total = spread = 0.0
    for k in range(rows):
        at = (k - (rows - 1) / 2.0) * period
        w = math.sin(math.pi * (k + 0.5) / rows) ** 4
        total += w
        spread += w * at * at
    spread /= total
    found = np.zeros(len(mean))
    for k in range(1, len(mean)):
        found[k] = 0.5 * (mean[k].real ** 2 + mean[k].imag ** 2 + spread * (trend[k].real ** 2 + trend[k].imag ** 2))
    return found


@njit(cache=True)
def between(values: Floats, spacing: float, count: int) -> Floats:
    """values (n,) at 0, spacing, 2 spacing ... (count,), in straight lines between neighbours; 0 beyond the last."""
    found = np.zeros(count)
    for k in range(count):
        place = k * spacing
        i = int(place)
        if i < len(values) - 1:
            found[k] = values[i] + (place - i) * (values[i + 1] - values[i])
        elif place <= len(values) - 1:
            found[k] = values[i]
    return found


@njit(cache=True)
def distance(frequency: float, first: float, spacing: float) -> float:
    """Distance [Hz] of a frequency from the nearest of |first + i spacing|."""
    up, down = (frequency - first) / spacing, (frequency + first) / spacing
    return float(min(abs(up - np.rint(up)), abs(down - np.rint(down))) * spacing)


@njit(cache=True)
def family_sums(frequency: Floats, energy: Floats, first: float, tooth: float, spindle: float,
                tolerance: float) -> tuple[NDArray[np.bool_], float, float]:
    """Which lines (n,) lie at |first + i tooth|; energy of those and of the ones of 2 and 3 first; and that with the
    lines at |first + i spindle|. All frequencies and the tolerance in Hz.
    """
    own = np.zeros(len(frequency), dtype=np.bool_)
    multiples = explained = 0.0
    for k in range(len(frequency)):
        own[k] = distance(frequency[k], first, tooth) <= tolerance
        member = own[k]
        for m in (2.0, 3.0):
            member = member or distance(frequency[k], m * first, tooth) <= tolerance
        if member:
            multiples += energy[k]
        if member or distance(frequency[k], first, spindle) <= tolerance:
            explained += energy[k]
    return own, multiples, explained


@njit(cache=True)
def upper_median(values: Floats) -> float:
    """The element of rank len(values) // 2 from 0, by quickselect; `values` is reordered."""
    low, high, rank = 0, len(values) - 1, len(values) // 2
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return float(values[rank])


@njit(cache=True)
def block_medians(power: Floats, block: int) -> Floats:
    """Medians of the whole blocks of `power` (n,), joined by straight lines between the blocks' middles (n,)."""
    count, size = max(1, len(power) // block), min(block, len(power))
    medians = np.empty(count)
    for b in range(count):
        medians[b] = upper_median(power[b * size: (b + 1) * size].copy())
    floor = np.empty(len(power))
    for k in range(len(power)):
        place = min(max(k / block - 0.5, 0.0), count - 1.0)
        i = min(int(place), max(0, count - 2))
        floor[k] = medians[i]
        if count > 1:
            floor[k] += (place - i) * (medians[i + 1] - medians[i])
    return floor


@njit(cache=True)
def tapered(x: Floats, window: Floats, count: int) -> Floats:
    """x (n,) less its mean, times a window (n,), followed by zeros: (count,)."""
    total = 0.0
    for k in range(len(x)):
        total += x[k]
    found = np.zeros(count)
    for k in range(len(x)):
        found[k] = (x[k] - total / len(x)) * window[k]
    return found


@njit(cache=True)
def largest_near(values: Floats, places: Floats, reach: int) -> Floats:
    """Largest of values (n,) within `reach` of each place (m,), rounded to the next; 0 where that is not inside."""
    found = np.zeros(len(places))
    for i in range(len(places)):
        at = int(np.rint(places[i]))
        if reach <= at < len(values) - reach:
            found[i] = values[at - reach: at + reach + 1].max()
    return found


@njit(cache=True)
def strongest_peaks(power: Floats, floor: Floats, lowest: int, ratio: float, most: int,
                    lobe: int) -> tuple[NDArray[np.int64], Floats]:
    """Bins of the `most` strongest peaks of `power` (n,) from bin `lowest` on and above `ratio` times the floor (n,).

    Strongest first, each with its energy: what its main lobe, `lobe` bins on either side, holds above the floor and no
    stronger peak has taken. A peak in the lobe of a stronger one is part of it.
    """
    at = np.empty(len(power), dtype=np.int64)
    count = 0
    for k in range(max(1, lowest), len(power) - 1):
        p = power[k]
        if p > ratio * floor[k] and p > power[k - 1] and p >= power[k + 1]:
            at[count] = k
            count += 1
    taken = np.zeros(len(power), dtype=np.bool_)
    bins, energy = np.empty(most, dtype=np.int64), np.empty(most)
    found = 0
    while found < most:
        best = -1
        for i in range(count):
            if not taken[at[i]] and (best < 0 or power[at[i]] > power[best]):
                best = at[i]
        if best < 0:
            break
        total = 0.0
        for k in range(max(0, best - lobe), min(len(power), best + lobe + 1)):
            if not taken[k]:
                total += power[k] - floor[k]
                taken[k] = True
        bins[found], energy[found] = best, max(total, 0.0)
        found += 1
    return bins[:found], energy[:found]
