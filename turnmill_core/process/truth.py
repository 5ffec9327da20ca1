"""What really happened in a simulated cut: synchronous and asynchronous amplitude without noise.

The displacement of the tool relative to the workpiece, in the plane of the chip, is sampled at equal
angles of the tool spindle while the equations of motion are integrated, so no speed has to be
estimated. Over a window of PERIODS principal periods, and for each angle apart, a straight line
is fitted through the values of successive periods:

- synchronous amplitude: rms over the angle of the lines' values in the middle of the window, less
  their mean (the static deflection);
- asynchronous amplitude: rms of the residuals about the lines, and with an odd number of teeth of what repeats every
  two revolutions but is no half-order line: chatter that has locked to the spindle, and no part of the synchronous one;
- half-order amplitude: the part of the synchronous amplitude at odd multiples of half the tooth
  passing frequency (no value where tooth spacing is uneven);
- chatter frequency: of the strongest line of the residuals (x and y together).

x and y are added in squares. The principal period is one tool revolution, and two for an odd number
of equally spaced teeth, where half the tooth passing frequency is not a multiple of the spindle's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Tool

Floats = NDArray[np.float64]

MARKS_PER_TURN = 240
PERIODS = 8
CROSSING = 0.2
AMPLITUDES = ("time", "synchronous", "asynchronous", "half_order", "frequency")
FIELDS = (*AMPLITUDES, "in_cut", "touched")


@dataclass(frozen=True, eq=False)
class Truth:
    """Noise-free amplitudes at the middle of successive windows.

    time (n,) [s] since the first axis state; synchronous, asynchronous, half_order (n,) [m rms];
    frequency (n,): strongest asynchronous line [Hz]; in_cut (n,): some chip is cut in every tool
    revolution of the window; touched (n,): some chip is cut in the window.
    """

    time: Floats
    synchronous: Floats
    asynchronous: Floats
    half_order: Floats
    frequency: Floats
    in_cut: NDArray[np.bool_]
    touched: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in FIELDS:
            array = getattr(self, name)
            if array.shape != self.time.shape:
                raise ValueError(f"truth {name} has shape {array.shape}, expected {self.time.shape}")
            array.flags.writeable = False

    @property
    def ratio(self) -> Floats:
        """Asynchronous over synchronous amplitude, NaN where the tool is not in the cut."""
        ratio = np.full(self.time.shape, np.nan)
        np.divide(self.asynchronous, self.synchronous, out=ratio, where=self.in_cut & (self.synchronous > 0))
        return ratio


@dataclass(frozen=True)
class Crossing:
    """When the asynchronous amplitude passes a share of the synchronous one: time [s] and whether it is rising."""

    time: float
    rising: bool


def principal_turns(tool: Tool) -> int:
    """Tool revolutions in one principal period: 2 for an odd number of equally spaced teeth, else 1."""
    return 2 if tool.teeth % 2 and np.ptp(tool.pitch) < 1e-9 else 1


def truth_of_marks(
    marks: Floats, teeth: int, turns: int, uneven: bool = False, hop: int = 1, periods: int = PERIODS,
) -> tuple[Truth, Floats]:
    """Amplitudes of every full window in `marks`, and the marks that later windows need.

    marks (n, 4): time [s], relative displacement x, y [m], largest chip [m] since the mark before,
    at equal angles, MARKS_PER_TURN to the revolution, beginning at a principal period. turns: tool
    revolutions in a principal period; uneven: the teeth are not equally spaced;
    hop: principal periods from window to window; periods: principal periods in a window. A line that turns by less than
    a quarter over the window counts as synchronous.
    """
    length = MARKS_PER_TURN * turns
    windows = max(0, (len(marks) // length - periods) // hop + 1)
    half_order = teeth * turns // 2 if (teeth * turns) % 2 == 0 and not uneven else 0
    values = np.zeros((windows, len(AMPLITUDES)))
    in_cut = np.zeros(windows, dtype=np.bool_)
    touched = np.zeros(windows, dtype=np.bool_)
    for i in range(windows):
        window = marks[i * hop * length : (i * hop + periods) * length]
        values[i] = _amplitudes(window, length, half_order)
        chips = window[:, 3].reshape(-1, MARKS_PER_TURN).max(axis=1)
        in_cut[i] = bool(np.all(chips > 0))
        touched[i] = bool(np.any(chips > 0))
    truth = Truth(in_cut=in_cut, touched=touched, **{name: values[:, c].copy() for c, name in enumerate(AMPLITUDES)})
    return truth, marks[windows * hop * length :].copy()


def _amplitudes(window: Floats, length: int, half_order: int) -> tuple[float, float, float, float, float]:
    """Middle time, synchronous, asynchronous and half-order amplitude and chatter frequency of one window."""
    values = window[:, 1:3].reshape(-1, 2 * length)
    periods = len(values)
    step = np.arange(periods) - (periods - 1) / 2
    mean = values.mean(axis=0)
    residual = values - mean - step[:, None] * ((step @ values) / np.sum(step**2))
    mean = mean.reshape(length, 2)
    synchronous = np.sqrt(np.sum(np.var(mean, axis=0)))
    asynchronous = np.sqrt(np.vdot(residual, residual) / (length * periods))
    half = 0.0
    if half_order:
        lines = 2 * np.abs(np.fft.rfft(mean, axis=0)[: length // 2]) ** 2 / length**2
        half = float(np.sqrt(np.sum(lines[half_order :: 2 * half_order])))
        if length > MARKS_PER_TURN:
            other = max(0.0, float(np.sum(lines[1::2])) - half**2)
            asynchronous = np.hypot(asynchronous, math.sqrt(other))
            synchronous = math.sqrt(max(0.0, synchronous**2 - other))
    middle = float(np.interp((len(window) - 1) / 2, np.arange(len(window)), window[:, 0]))
    rate = (len(window) - 1) / (window[-1, 0] - window[0, 0])
    return middle, float(synchronous), float(asynchronous), half, _strongest(residual.reshape(-1, 2)) * rate


def _strongest(values: Floats) -> float:
    """Frequency of the strongest line in `values` (n, 2), in cycles per sample, by a parabola through the peak."""
    if not np.any(values):
        return np.nan
    windowed = values.T * np.hanning(len(values))
    lines = np.fft.rfft(windowed, 2 * len(values))
    power = np.sum(lines.real**2 + lines.imag**2, axis=0)
    peak = int(np.argmax(power[1:-1])) + 1
    left, top, right = np.log(power[peak - 1 : peak + 2] + np.finfo(float).tiny)
    curve = left - 2 * top + right
    return float((peak + (0.5 * (left - right) / curve if curve < 0 else 0.0)) / (2 * len(values)))


def join_truth(parts: Iterable[Truth]) -> Truth:
    """One truth from successive parts."""
    found = list(parts)
    if not found:
        return truth_of_marks(np.zeros((0, 4)), 1, 1)[0]
    return Truth(*(np.concatenate([getattr(part, name) for part in found]) for name in FIELDS))


def crossings(truth: Truth, share: float = CROSSING) -> tuple[Crossing, ...]:
    """Moments when the asynchronous amplitude passes `share` of the synchronous one, while in the cut.

    The ratio is interpolated linearly in its logarithm between windows. A move into or out of the cut
    is no crossing, nor is the end of the transient that every entry begins with.
    """
    ratio = truth.ratio
    found: list[Crossing] = []
    settled = False
    for i in range(1, len(ratio)):
        before, after = ratio[i - 1], ratio[i]
        entering = not settled
        settled = not np.isnan(after) and (settled or after <= share)
        if entering:
            continue
        if np.isnan(before) or np.isnan(after) or (before > share) == (after > share):
            continue
        low, high = np.log(max(before, 1e-12)), np.log(max(after, 1e-12))
        part = (np.log(share) - low) / (high - low)
        time = truth.time[i - 1] + part * (truth.time[i] - truth.time[i - 1])
        found.append(Crossing(float(time), bool(after > before)))
    return tuple(found)
