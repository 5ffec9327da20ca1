"""The monitor and its rivals on one signal of the corpus, window by window."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turnmill_core.detection.cuts import Cut, generator, make_cut
from turnmill_core.detection.endless import go_on, quiet_motion
from turnmill_core.detection.recordings import (
    RATE,
    Episode,
    Motion,
    Observed,
    episode,
    observe,
    simulate_cut,
    true_kinds,
)
from turnmill_core.detection.rivals import RIVALS, rate_windows
from turnmill_core.monitoring.chatter import ChatterConfig, config_from_operation, finish, initial, update
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_core.operation import Operation
from turnmill_core.prediction import Prior, flip_multiplier
from turnmill_core.stability.margin import stability_point

INDICATORS = ("turnmill", *(r.name for r in RIVALS))
ALARMS = (ChatterKind.HOPF, ChatterKind.FLIP)
NO_TRUTH = -1
TACHOMETER_ERROR = 0.01
WRONG_FREQUENCY, WRONG_FORCE = 0.05, 0.2


@dataclass(frozen=True)
class Heard:
    """One signal: what was said and what was true.

    kind, number, teeth: of the cut; seconds: of signal; ends (n,): of the windows [s]; truth (n,): true kind
    or NO_TRUTH; state (n,): verdict; scores (n, INDICATORS): ours, see :func:`scores`, and those of the RIVALS with the
    gate; ungated (n, RIVALS): theirs without; episode: the true chatter, if any; cpu: of the monitor [s]; rival_cpu:
    of the RIVALS; changed: windows whose state is another with a tachometer that is 1 % wrong (NaN: not asked);
    with_prior (n,): verdict with a prior from a wrong model (empty: not asked); by_runout: windows that a known runout
    decides rightly, leaves undecided, and all of them, see known_runout.py.
    """

    kind: str
    number: int
    teeth: int
    seconds: float
    ends: NDArray[np.float64]
    truth: NDArray[np.int8]
    state: NDArray[np.int8]
    scores: NDArray[np.float32]
    ungated: NDArray[np.float32]
    episode: Episode | None
    cpu: float
    rival_cpu: tuple[float, ...]
    changed: float
    with_prior: NDArray[np.int8]
    by_runout: tuple[int, int, int] = (0, 0, 0)


def listen(config: ChatterConfig, seen: Observed, prior: Prior | None = None) -> list[Verdict]:
    """Verdicts on a signal."""
    state, verdicts = initial(config), list[Verdict]()
    for item in [*([] if prior is None else [prior]), *seen.items()]:
        state, found = update(config, state, item)
        verdicts.extend(found)
    return [*verdicts, *finish(config, state)[1]]


def wrong_prior(cut: Cut) -> Prior:
    """Prediction of a model whose natural frequencies are up to 5 % off and whose force coefficients up to 20 %."""
    rng = generator(cut.kind, cut.number, "prior")

    def off(share: float) -> float:
        return float(1 + rng.uniform(-share, share))

    op = cut.operation
    modes = tuple(replace(m, frequency=m.frequency * off(WRONG_FREQUENCY)) for m in op.tool.structure.modes)
    material = replace(op.material, Ktc=op.material.Ktc * off(WRONG_FORCE), Krc=op.material.Krc * off(WRONG_FORCE))
    wrong = replace(op, tool=replace(op.tool, structure=replace(op.tool.structure, modes=modes)), material=material)
    return predicted(wrong)


def predicted(op: Operation) -> Prior:
    """Prediction for the nominal cut of an operation."""
    point = stability_point(op, op.conditions)
    return Prior(0, point.predicted_type, point.spectral_radius, point.chatter_frequency,
                 flip_multiplier(point.multipliers))


SUREST = 0.9999
"""Confidence above which nothing more is made of it."""


def scores(verdicts: Sequence[Verdict]) -> NDArray[np.float32]:
    """How strongly verdicts speak of chatter (n,), from what is published of them up to each window.

    In an alarm: 1 + the sum of -ln(1 - confidence) over the windows in a row that show it by themselves, the
    improbability of all of them being wrong; 1 where it is only held. Else below 1: the asynchronous or the half-order
    ratio, whichever is larger, times the probability of chatter, which is one half where the verdict is undecided and
    what the confidence leaves of 1 where it is another.
    """
    found, run = np.zeros(len(verdicts), dtype=np.float32), 0.0
    for k, v in enumerate(verdicts):
        if v.state in ALARMS:
            run = 0.0 if v.reason is Reason.PERSISTENCE else run - math.log(1 - min(SUREST, v.confidence))
            found[k] = 1 + run
            continue
        run = 0.0
        undecided = v.state in (ChatterKind.MARGINAL, ChatterKind.FLIP_OR_RUNOUT)
        ratio = max((r for r in (v.asynchronous_ratio, v.half_order_ratio) if math.isfinite(r)), default=0.0)
        found[k] = min(1.0, max(0.0, ratio) * (0.5 if undecided else 1 - v.confidence))
    return found


def _heard(cut: Cut, seen: Observed, config: ChatterConfig) -> tuple[Heard, list[Verdict]]:
    begin = time.process_time()
    verdicts = listen(config, seen)
    cpu = time.process_time() - begin
    rated = rate_windows(seen, cut.operation.tool.teeth, verdicts)
    table = np.column_stack([scores(verdicts), rated.gated])
    return Heard(cut.kind, cut.number, cut.operation.tool.teeth, len(seen.samples) / RATE,
                 np.array([v.window_end_ns * 1e-9 for v in verdicts]), np.zeros(0, dtype=np.int8), _states(verdicts),
                 table, rated.ungated, None, cpu, rated.cpu, math.nan, np.zeros(0, dtype=np.int8)), verdicts


def _states(verdicts: Sequence[Verdict]) -> NDArray[np.int8]:
    return np.array([int(v.state) for v in verdicts], dtype=np.int8)


def hear_cut(kind: str, number: int, tachometer: bool = False, prior: bool = False) -> Heard:
    """One simulated cut, see :func:`hear_motion`."""
    return hear_motion(simulate_cut(make_cut(kind, number)), tachometer, prior)


def hear_motion(motion: Motion, tachometer: bool = False, prior: bool = False) -> Heard:
    """Motion of a cut; tachometer, prior: also with a tachometer 1 % wrong, with a prior from a wrong model."""
    cut, config = motion.cut, config_from_operation(motion.cut.operation)
    seen = observe(motion)
    heard, verdicts = _heard(cut, seen, config)
    truth = np.array([NO_TRUTH if k is None else int(k) for k in true_kinds(cut, seen, verdicts)], dtype=np.int8)
    heard = replace(heard, truth=truth, episode=episode(cut, seen))
    if tachometer:
        heard = replace(heard, changed=_changed(heard, config, observe(motion, _tachometer_error(cut.number))))
    if prior:
        heard = replace(heard, with_prior=_states(listen(config, seen, wrong_prior(cut))))
    return heard


def _tachometer_error(number: int) -> float:
    return TACHOMETER_ERROR if number % 2 else -TACHOMETER_ERROR


def _changed(heard: Heard, config: ChatterConfig, wrong: Observed) -> float:
    """Windows in which the same signal with another tachometer is judged otherwise."""
    return float(np.sum(_states(listen(config, wrong)) != heard.state))


def hear_quiet(kind: str, number: int, part: int, motion: Motion | None = None, tachometer: bool = False) -> Heard:
    """A minute without chatter; motion: of the cut that goes on (None: made again); tachometer: as in a cut."""
    motion = quiet_motion(kind, number) if motion is None else motion
    seen = go_on(motion, kind, number, part)
    config = config_from_operation(motion.cut.operation)
    heard, verdicts = _heard(motion.cut, seen, config)
    if tachometer:
        wrong = go_on(motion, kind, number, part, extra_error=_tachometer_error(number))
        heard = replace(heard, changed=_changed(heard, config, wrong))
    true = ChatterKind.AIR if kind == "air" else ChatterKind.STABLE
    return replace(heard, kind=kind, truth=np.full(len(verdicts), int(true), dtype=np.int8))
