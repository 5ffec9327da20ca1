"""Minutes of signals without chatter, of many kinds: no alarm."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import RATE, comb, judged, noise, phase
from turnmill_core.monitoring.decision import CHATTER
from turnmill_core.monitoring.verdict import ChatterKind

SECONDS = 6.0


def signal(kind: str, seed: int) -> tuple[np.ndarray, int, float]:
    """Signal, teeth and true spindle speed [rad/s]."""
    rng = np.random.default_rng(seed)
    teeth = int(rng.choice([3, 4, 5, 6]))
    rpm = float(rng.uniform(1500, 12000))
    speed = rpm * 2 * math.pi / 60
    t = phase(speed, SECONDS)
    at = np.arange(len(t)) / RATE
    x = comb(t, teeth, runout=float(rng.uniform(0, 0.5)), seed=seed)
    quiet = noise(len(t), 0.1, seed)
    if kind == "loud":
        return x + noise(len(t), 0.7, seed), teeth, speed
    if kind == "resonance":
        strongest = max(1, int(rng.uniform(500, 4500) * 60 / rpm / teeth)) * teeth
        return x + 6 * np.cos(2 * math.pi * strongest * t) + quiet, teeth, speed
    if kind == "entry and exit":
        return x * np.clip(np.sin(2 * math.pi * at / 1.5) * 4, 0, 1) + quiet, teeth, speed
    if kind == "swelling":
        return x * (1 + 0.6 * np.sin(2 * math.pi * at * float(rng.uniform(0.2, 1.5)))) + quiet, teeth, speed
    if kind == "air with machine tones":
        tones = sum(0.05 * np.cos(2 * math.pi * f * at + f) for f in rng.uniform(80, 3000, 8))
        return tones + quiet, teeth, speed
    if kind == "coolant":
        roar = np.convolve(noise(len(t), 1.0, seed), np.hanning(9), "same")
        return quiet + roar * (at > 2), teeth, speed
    return x * (1 + 0.1 * noise(len(t), 1.0, seed)) + quiet, teeth, speed


KINDS = ("loud", "resonance", "entry and exit", "swelling", "air with machine tones", "coolant", "rough")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axes", [True, False])
def test_no_chatter(kind: str, axes: bool) -> None:
    for seed in range(2):
        x, teeth, speed = signal(kind, seed)
        declared = speed * (1 if axes else 1.006)
        verdicts = judged(x, teeth, declared, axes=axes)
        bad = [v for v in verdicts if v.state in CHATTER]
        assert not bad, bad[0]
        if "air" in kind or kind == "coolant":
            assert {v.state for v in verdicts} <= {ChatterKind.AIR, ChatterKind.UNKNOWN}
