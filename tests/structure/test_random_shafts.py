"""Stepped shafts at random: pieces against the whole, there and back; a few in the tests, many in the full count."""

from __future__ import annotations

import numpy as np
import pytest

from turnmill_core.operation_structure import BeamMaterial, Chuck, ChuckMode
from turnmill_core.structure.beam import free_bar, on_chuck, receptances
from turnmill_core.structure.profile import BarProfile
from turnmill_core.structure.receptance import (
    base_under,
    chuck_from_dummy,
    chuck_receptance,
    couple,
    end_receptances,
    on_base,
    seated_receptances,
)

COUNTS = [pytest.param(4, id="4"), pytest.param(300, id="300", marks=pytest.mark.slow)]


def shaft(rng: np.random.Generator) -> tuple[BarProfile, BeamMaterial, Chuck, np.ndarray]:
    """A shaft of one to four steps, its material, a chuck, and frequencies [Hz]."""
    steps = int(rng.integers(1, 5))
    length = rng.uniform(0.08, 0.4)
    parts = rng.uniform(0.2, 1.0, steps)
    edges = np.concatenate([[0.0], np.cumsum(parts / parts.sum())]) * length
    profile = BarProfile(edges, rng.uniform(0.02, 0.06, steps))
    material = BeamMaterial(rng.uniform(60e9, 220e9), rng.uniform(2600, 8000), rng.uniform(0.2, 0.4), 0.002)
    chuck = Chuck((ChuckMode(rng.uniform(200, 800), rng.uniform(0.01, 0.1), rng.uniform(5, 20), rng.uniform(0.1, 1)),),
                  rng.uniform(3e8, 3e9), rng.uniform(3e5, 3e6), rng.uniform(0, 2e3), rng.uniform(0, 50))
    return profile, material, chuck, np.geomspace(60.0, 4000.0, 25)


def apart(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation relative to the largest receptance of its kind at each frequency."""
    return float((np.abs(found - expected) / np.abs(expected).max(axis=-1, keepdims=True)).max())


@pytest.mark.parametrize("count", COUNTS)
def test_cut_in_two_and_coupled(count: int) -> None:
    """A shaft cut in two pieces equals the whole to 1e-10; beside a resonance rounding takes one digit more."""
    rng, worst = np.random.default_rng(11), []
    for _ in range(count):
        profile, material, _, f = shaft(rng)
        step = int(rng.integers(profile.radius.size))
        place = float(profile.edges[step] + rng.uniform(0.3, 0.7) * np.diff(profile.edges)[step])
        whole = free_bar(profile, material, order=3, ends_at=[place])
        pieces = [end_receptances(free_bar(profile.part(a, b), material, order=3), f)
                  for a, b in ((0.0, place), (place, profile.length))]
        found, expected = couple(*pieces), end_receptances(whole, f)
        worst.append(max(apart(getattr(found, n), getattr(expected, n)) for n in ("r11", "r12", "r21", "r22")))
    assert np.percentile(worst, 99) < 1e-10
    assert max(worst) < 1e-9


@pytest.mark.parametrize("count", COUNTS)
def test_there_and_back(count: int) -> None:
    """Base found under a tip, and a chuck found under a dummy, give tip and dummy again to 1e-9."""
    rng, worst = np.random.default_rng(12), 0.0
    for _ in range(count):
        profile, material, chuck, f = shaft(rng)
        bar = free_bar(profile, material)
        ends = end_receptances(bar, f)
        tip = on_base(ends, chuck_receptance(chuck, f))
        worst = max(worst, apart(on_base(ends, base_under(ends, tip)), tip))
        held, points = on_chuck(bar, chuck), (0.0, rng.uniform(0.3, 0.7) * profile.length)
        H = receptances(held, np.vstack([held.row(s) for s in points]), f)
        base = chuck_from_dummy(bar, points, f, H[:, 0, 0], H[:, 0, 1], H[:, 1, 1])
        again = seated_receptances(bar, np.vstack([bar.row(s) for s in points]), base, f)
        worst = max(worst, apart(again, H))
    assert worst < 1e-9
