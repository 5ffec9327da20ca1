"""Modes from measured receptances: poles by sdypy-EMA, real modes by least squares.

The library finds the poles of each receptance (least squares complex frequency); those that stay as the order of the
polynomial grows are modes. Real modes with what lies below and above the band are then fitted to the receptance itself.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from turnmill_ros.errors import InputError
from turnmill_ros.frf_file import FrfFile

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ORDER = 40
"""Largest order of the polynomial."""
_SAME_FREQUENCY, _SAME_DAMPING = 0.003, 0.15
_SHARE_OF_ORDERS, _SHARE_OF_PEAK = 0.35, 0.015


@dataclass(frozen=True)
class FittedMode:
    """One mode of one receptance.

    frequency [Hz]; damping [1]; mass [kg], negative where the receptance's residue is; phase [rad]: lead of the complex
    residue over that of a real mode.
    """

    frequency: float
    damping: float
    mass: float
    phase: float


@dataclass(frozen=True)
class ReceptanceFit:
    """The fit of one receptance.

    pair: directions of response and force; modes; fitted (k,) [m/N] at the frequencies (k,) [Hz] of the band; error:
    root mean square deviation over that of the receptance; stable (m, 2): frequency [Hz] and order of stable poles.
    """

    pair: str
    modes: tuple[FittedMode, ...]
    frequency: Floats
    measured: Complexes
    fitted: Complexes
    error: float
    stable: Floats


def fit_modes(
    frfs: FrfFile, band: tuple[float, float] | None = None, near: Sequence[float] = (), order: int = ORDER,
) -> tuple[ReceptanceFit, ...]:
    """Fit every receptance of a file by itself.

    band [Hz]: what is fitted [default: all]; near [Hz]: about where the modes are [default: every stable pole that
    shows]; order: largest order of the polynomial. Raises InputError where no mode is found.
    """
    low, high = band or (float(frfs.frequency[0]), float(frfs.frequency[-1]))
    inside = (frfs.frequency >= low) & (frfs.frequency <= high)
    if low >= high or inside.sum() < 16:
        raise InputError("band", value=[low, high], expected="two frequencies [Hz] with at least 16 lines between")
    if any(not low < f < high for f in near):
        raise InputError("modes near", value=list(near), expected=f"frequencies between {low:g} and {high:g} Hz")
    return tuple(_fit(pair, frfs.frequency[inside], H[inside], near, order)
                 for pair, H in zip(frfs.pairs, frfs.receptance, strict=True))


def _fit(pair: str, f: Floats, H: Complexes, near: Sequence[float], order: int) -> ReceptanceFit:
    poles, stable = _poles(f, H, near, order)
    if not poles.size:
        raise InputError("no mode found", key=pair, expected="a resonance within the band", hint="try --near or --band")
    poles = _visible(f, H, poles) if not near else poles
    found = _refined(f, H, poles)
    w0, zeta = np.abs(found), -found.real / np.abs(found)
    real, fitted = _residues(f, H, found)
    error = float(np.linalg.norm(fitted - H) / np.linalg.norm(H))
    modes = tuple(FittedMode(float(w) / (2 * np.pi), float(z), 1 / float(c), float(phase))
                  for w, z, c, phase in zip(w0, zeta, real, _phases(f, H, poles), strict=True))
    for mode in modes:
        if not 0 < mode.damping < 1:
            raise InputError("a mode that is not damped", key=f"{pair} at {mode.frequency:.1f} Hz", value=mode.damping,
                             expected="a damping ratio between 0 and 1", hint="try --near or --band")
        if pair[0] == pair[1] and mode.mass < 0:
            raise InputError("a direct receptance with a negative mode", key=f"{pair} at {mode.frequency:.1f} Hz",
                             expected="a residue > 0: response and force in the same sense",
                             hint="a sensor or hammer with the wrong sign, or --near for fewer modes")
    return ReceptanceFit(pair, modes, f, H, fitted, error, stable)


def _poles(f: Floats, H: Complexes, near: Sequence[float], order: int) -> tuple[Complexes, Floats]:
    """Poles [rad/s] with positive frequency, and all stable ones as (frequency [Hz], order)."""
    model = _library()(frf=H[None, :], freq=f, lower=max(float(f[0]), 1e-3), upper=float(f[-1]), pol_order_high=order,
                       frf_form="receptance")
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        model.get_poles(method="lscf", show_progress=False)
    orders = [np.asarray(p, dtype=np.complex128) for p in model.all_poles]
    kept: list[tuple[int, complex]] = []
    for n, (before, now) in enumerate(pairwise(orders), 1):
        for pole in now[(now.imag > 0) & (now.real < 0)]:
            fn, zn = abs(pole), -pole.real / abs(pole)
            if not (f[0] < fn / (2 * np.pi) < f[-1]) or zn > 0.4 or not before.size:
                continue
            fo, zo = np.abs(before), -before.real / np.abs(before)
            same = (np.abs(fo / fn - 1) < _SAME_FREQUENCY) & (np.abs(zo / zn - 1) < _SAME_DAMPING) & (before.imag > 0)
            if np.any(same):
                kept.append((n, complex(pole)))
    stable = np.array([(abs(p) / (2 * np.pi), n) for n, p in kept]).reshape(-1, 2)
    if near:
        if not kept:
            return np.array([2j * np.pi * x - 0.02 * 2 * np.pi * x for x in near]), stable
        found = [min((p for _, p in kept), key=lambda p, x=x: abs(abs(p) / (2 * np.pi) - x)) for x in near]
        return np.array(found), stable
    kept.sort(key=lambda item: abs(item[1]))
    clusters: list[list[complex]] = []
    for _, pole in kept:
        if clusters and abs(pole) / abs(clusters[-1][-1]) - 1 < _SAME_FREQUENCY:
            clusters[-1].append(pole)
        else:
            clusters.append([pole])
    enough = _SHARE_OF_ORDERS * len(orders)
    found = [np.median(np.real(c)) + 1j * np.median(np.imag(c)) for c in clusters if len(c) >= enough]
    return np.array(found, dtype=np.complex128), stable


def _library() -> Any:
    try:
        from sdypy.EMA import Model
    except ImportError as error:
        raise InputError("identifying modes needs sdypy-EMA", hint="pip install 'turnmill[modal]'") from error
    return Model


def _basis(f: Floats, poles: Complexes) -> Complexes:
    """Response of each mode to its force, and of what lies below (mass) and above (stiffness) the band; (k, m + 2)."""
    w = 2 * np.pi * f[:, None]
    w0, zeta = np.abs(poles), -poles.real / np.abs(poles)
    return np.hstack([1 / (w0**2 - w**2 + 2j * zeta * w0 * w), -1 / w**2, np.full(w.shape, 1 / (w[-1, 0] ** 2))])


def _real(columns: Complexes) -> Floats:
    return np.concatenate([columns.real, columns.imag])


def _residues(f: Floats, H: Complexes, poles: Complexes) -> tuple[Floats, Complexes]:
    """Real residues 1/m (m,) and the fit with them (k,)."""
    basis = _basis(f, poles)
    solved = np.linalg.lstsq(_real(basis), _real(H), rcond=None)[0]
    return solved[: poles.size], basis @ solved


def _phases(f: Floats, H: Complexes, poles: Complexes) -> Floats:
    """Lead [rad] of each complex residue over that of a real mode, for the poles as the library found them.

    The numerator b + a s of a mode has a = sin(phase) / (m w_d) and b = (cos(phase) + zeta w0 / w_d sin(phase)) / m.
    """
    m, w0 = poles.size, np.abs(poles)
    basis = _basis(f, poles)
    moving = basis[:, :m] * 2j * np.pi * f[:, None] / w0
    solved = np.linalg.lstsq(_real(np.hstack([basis, moving])), _real(H), rcond=None)[0]
    sine = solved[m + 2:] / w0 * poles.imag
    return np.asarray(np.arctan2(sine, solved[:m] + poles.real / poles.imag * sine))


def _visible(f: Floats, H: Complexes, poles: Complexes) -> Complexes:
    """The poles whose own peak shows in the receptance."""
    real, _ = _residues(f, H, poles)
    peak = np.abs(real) / (2 * np.abs(poles.real) * np.abs(poles))
    return poles[peak > _SHARE_OF_PEAK * np.abs(H).max()]


def _refined(f: Floats, H: Complexes, poles: Complexes) -> Complexes:
    """Poles that fit best with real residues; the residues are linear and solved within."""
    size = np.abs(H) + 0.05 * np.abs(H).max()

    def at(x: Floats) -> Complexes:
        w0, zeta = np.exp(x[: poles.size]), np.exp(x[poles.size:])
        return np.asarray(-zeta * w0 + 1j * w0 * np.sqrt(np.maximum(1 - zeta**2, 1e-9)))

    def deviation(x: Floats) -> Floats:
        basis = _basis(f, at(x)) / size[:, None]
        solved = np.linalg.lstsq(_real(basis), _real(H / size), rcond=None)[0]
        return _real(basis @ solved - H / size)

    start = np.log(np.concatenate([np.abs(poles), -poles.real / np.abs(poles)]))
    reach = np.concatenate([np.full(poles.size, 0.05), np.full(poles.size, 1.5)])
    return at(least_squares(deviation, start, bounds=(start - reach, start + reach), x_scale=reach).x)
