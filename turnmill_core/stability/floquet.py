"""Verdict from the Floquet multipliers of one principal period (Eq. 4.106-4.108, erratum D4).

Rules
-----
- Stable: every multiplier lies inside the unit circle.
- Flip: the leading multiplier is real and below -1 (period doubling; primary with one such
  multiplier, secondary with two). Hopf: it is any other number outside the unit circle.
- Chatter frequencies: the Floquet solution is d(t) = Re[p(t) exp(s t)] with p of period T and
  s = ln(mu) / T, so its spectrum has the lines |arg(mu) / T + 2 pi q / T|, q any integer (Eq. 4.107).
  A flip has arg(mu) = pi and its lines are (q + 1/2) / T (Eq. 4.108 with the tooth period).
- Dominant frequency: the line with the largest Fourier coefficient of p(t), by the norm of the
  displacement vector of tool against workpiece over x, y and z. Lines that fall on one frequency
  (arg(mu) = 0 or pi) are added before they are compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import ArpackNoConvergence, eigs

from turnmill_core.prediction import PredictedType
from turnmill_core.stability.threads import one_thread

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LARGE = 300
"""Size of a map beyond which only its leading multipliers are computed."""
REAL_TOLERANCE = 1e-9
"""A multiplier counts as real when |Im| is below this times its magnitude."""


@dataclass(frozen=True)
class ChatterLine:
    """One line of the chatter spectrum.

    frequency [Hz]; order q of |arg(mu)/T + 2 pi q/T|; share of the squared amplitude [1].
    """

    frequency: float
    order: int
    share: float


@dataclass(frozen=True, eq=False)
class FloquetVerdict:
    """Stability verdict of one operating point.

    multipliers: leading Floquet multipliers by falling magnitude. spectral_radius: largest
    magnitude [1]. predicted_type: STABLE, HOPF or FLIP. flips: number of real multipliers below -1
    (2: secondary flip). lines: spectrum of the leading Floquet solution, strongest line first, whether
    it grows or decays. chatter_frequency [Hz]: the strongest line where unstable, else NaN. period
    [s]: principal period that the multipliers belong to. error [1]: the solver's own estimate of the error
    of the spectral radius, NaN where it made none.
    """

    multipliers: Complexes
    spectral_radius: float
    predicted_type: PredictedType
    flips: int
    lines: tuple[ChatterLine, ...]
    chatter_frequency: float
    period: float
    error: float = float("nan")


def kinds(leading: ArrayLike) -> NDArray[np.uint8]:
    """Values of PredictedType for leading multipliers of any shape, one for each point of a diagram."""
    mu = np.asarray(leading, dtype=np.complex128)
    flip = (mu.real < 0) & (np.abs(mu.imag) <= REAL_TOLERANCE * np.abs(mu))
    unstable = np.where(flip, np.uint8(PredictedType.FLIP), np.uint8(PredictedType.HOPF))
    return np.where(np.abs(mu) < 1, np.uint8(PredictedType.STABLE), unstable)


def leading_first(multipliers: Complexes) -> NDArray[np.intp]:
    """Order of multipliers (n,) by falling magnitude, of a pair the one with Im > 0 first."""
    return np.lexsort((-multipliers.imag, -np.round(np.abs(multipliers), 12)))


def classify(multipliers: ArrayLike) -> PredictedType:
    """STABLE, HOPF or FLIP from multipliers (n,), any order. Raises ``ValueError`` when one is not finite."""
    mu = np.asarray(multipliers, dtype=np.complex128)
    if not np.all(np.isfinite(mu)):
        raise ValueError("a Floquet multiplier is not finite, expected finite multipliers; take more steps")
    return PredictedType(int(kinds(mu[np.argmax(np.abs(mu))])))


def chatter_family(multiplier: complex, period: float, highest: float) -> Floats:
    """All chatter frequencies [Hz] up to `highest` [Hz] of a multiplier: |arg(mu) + 2 pi q| / (2 pi T), ascending.

    period T [s]. Eq. 4.107 and, for a negative real multiplier, Eq. 4.108.
    """
    base = float(np.angle(multiplier)) / (2 * np.pi)
    q = np.arange(-int(highest * period) - 2, int(highest * period) + 3)
    frequencies = np.unique(np.round(np.abs(base + q) / period, 9))
    return frequencies[frequencies <= highest]


def spectrum_lines(
    multiplier: complex, displacement: Complexes, period: float, count: int = 9,
) -> tuple[ChatterLine, ...]:
    """Strongest lines of the Floquet solution with this multiplier.

    displacement (k, axes): complex displacement of the eigenvector at k equally spaced times i T / k of period T [s].
    Only orders |q| < k/2 are resolved. The amplitudes are those of the periodic part, so that growth does
    not weigh on them.
    """
    k = displacement.shape[0]
    exponent = np.log(complex(multiplier)) / k
    periodic = displacement * np.exp(-exponent * np.arange(k))[:, None]
    power = np.sum(np.abs(np.fft.fft(periodic, axis=0) / k) ** 2, axis=1)
    order = np.fft.fftfreq(k, 1 / k).round().astype(int)
    frequency = np.abs(np.angle(multiplier) / (2 * np.pi) + order) / period
    total = power.sum()
    if total == 0:
        return ()
    lines: dict[int, ChatterLine] = {}
    strongest = np.argsort(-power)[:8 * count]
    for f, q, p in zip(frequency[strongest], order[strongest], power[strongest] / total, strict=True):
        key = round(f * period * 1e6)
        held = lines.get(key)
        lines[key] = ChatterLine(float(f), int(q), float(p)) if held is None else ChatterLine(
            held.frequency, held.order, held.share + float(p))
    return tuple(sorted(lines.values(), key=lambda line: -line.share)[:count])


def verdict(multipliers: ArrayLike, leading_displacement: Complexes, period: float, keep: int = 6) -> FloquetVerdict:
    """Verdict from all multipliers and leading_displacement (k, 3), the leading eigenvector over one `period` [s].

    keep: number of multipliers in the verdict.
    """
    mu = np.asarray(multipliers, dtype=np.complex128)
    kind = classify(mu)
    mu = mu[leading_first(mu)]
    real = np.abs(mu.imag) <= REAL_TOLERANCE * np.maximum(np.abs(mu), 1e-300)
    lines = spectrum_lines(complex(mu[0]), leading_displacement, period)
    chatter = lines[0].frequency if lines and kind is not PredictedType.STABLE else float("nan")
    flips = int(np.sum(real & (mu.real < -1)))
    return FloquetVerdict(mu[:keep].copy(), float(np.abs(mu[0])), kind, flips, lines, chatter, period)


def verdict_from_map(matrix: Floats, displacement: Floats, period: float) -> FloquetVerdict:
    """Verdict from the matrix (L, L) over one period and its displacement observer (k, 3, L)."""
    if not np.all(np.isfinite(matrix)):
        raise ValueError("the map over one period is not finite, expected finite numbers; take more steps")
    with one_thread():
        mu = _leading(matrix) if len(matrix) > LARGE else np.linalg.eigvals(matrix).astype(np.complex128)
        leading = mu[leading_first(mu)[0]]
        vector = eigenvector(matrix, complex(leading))
    return verdict(mu, displacement @ vector, period)


def _leading(matrix: Floats, count: int = 8) -> Complexes:
    """Eigenvalues of largest magnitude of a large matrix; all of them where Arnoldi's method does not converge."""
    try:
        found = eigs(matrix, k=count, v0=np.cos(np.arange(len(matrix))), ncv=60, return_eigenvectors=False)
    except ArpackNoConvergence:
        found = np.linalg.eigvals(matrix)
    return np.asarray(found, dtype=np.complex128)


def eigenvector(matrix: Floats, value: complex) -> Complexes:
    """Unit eigenvector of `matrix` (L, L) for its eigenvalue `value`, by inverse iteration."""
    near = value + (1e-10 * abs(value) or 1e-300)
    factors = lu_factor(matrix - near * np.eye(len(matrix)), check_finite=False)
    vector = np.exp(1j * np.arange(len(matrix)))
    for _ in range(3):
        vector = lu_solve(factors, vector, check_finite=False)
        vector = vector / np.linalg.norm(vector)
    return np.asarray(vector, dtype=np.complex128)
