"""Flip or runout of an even number of teeth, decided by a runout that was measured, without any prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turnmill_core.cutting.runout import half_order_share
from turnmill_core.detection.cuts import Cut, generator, make_cut, much_runout
from turnmill_core.detection.hearing import WRONG_FORCE, listen
from turnmill_core.detection.recordings import observe, simulate_cut, true_kinds
from turnmill_core.monitoring.chatter import config_from_operation
from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_core.operation import Operation

WRONG_RUNOUT = 0.2
EVEN_KINDS = ("flip_even", "runout")


def measured(cut: Cut) -> Operation:
    """The operation of a cut with every tooth's runout and both force coefficients up to 20 % off."""
    rng = generator(cut.kind, cut.number, "measured runout")
    op = cut.operation
    runout = tuple(r * (1 + float(rng.uniform(-WRONG_RUNOUT, WRONG_RUNOUT))) for r in op.tool.runout)
    ktc, krc = (k * (1 + float(rng.uniform(-WRONG_FORCE, WRONG_FORCE))) for k in (op.material.Ktc, op.material.Krc))
    return replace(op, tool=replace(op.tool, runout=runout), material=replace(op.material, Ktc=ktc, Krc=krc))


def decided_by_runout(kind: str, number: int) -> tuple[int, int, int]:
    """Windows of a cut that a known runout decides rightly, of those that it leaves undecided, and of all asked.

    kind: "runout", or "flip_even" with the teeth run out as much. Asked are the windows of stable cuts, or that truly
    flip, which are FLIP_OR_RUNOUT to a monitor that knows nothing.
    """
    cut = make_cut(kind, number)
    cut = cut if kind == "runout" else much_runout(cut)
    seen, config = observe(simulate_cut(cut)), config_from_operation(cut.operation)
    op = measured(cut)
    verdicts = listen(replace(config, runout_share=half_order_share(op, op.conditions)), seen)
    states = np.array([v.state for v in verdicts])
    truth = np.array([-1 if k is None else int(k) for k in true_kinds(cut, seen, verdicts)])
    alike = np.array([v.state for v in listen(config, seen)]) == ChatterKind.FLIP_OR_RUNOUT
    right = ChatterKind.STABLE if kind == "runout" else ChatterKind.FLIP
    asked = (truth == right) & alike
    return (int(np.sum(states[asked] == right)), int(np.sum(states[asked] == ChatterKind.FLIP_OR_RUNOUT)),
            int(asked.sum()))
