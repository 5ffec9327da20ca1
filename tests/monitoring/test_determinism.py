"""Same items, same verdicts: whatever the block size and however blocks and speeds interleave."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.monitoring.signals import blocks, by_stamp, comb, hopf, noise, phase, speeds, watch
from turnmill_core.monitoring.chatter import ChatterConfig, finish, initial, update

SPEED = 4000 * 2 * math.pi / 60
SECONDS = 0.6
CONFIG = ChatterConfig(teeth=3, nominal_speed=SPEED)


def signal() -> np.ndarray:
    t = phase(SPEED, SECONDS)
    return comb(t, 3) + hopf(t, 3, 700.0, 0.5) + noise(len(t), 0.1, 4)


REFERENCE = watch(CONFIG, by_stamp(list(blocks(signal())), list(speeds(SPEED, SECONDS))))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 3000), min_size=1, max_size=12))
def test_block_size_does_not_matter(sizes: list[int]) -> None:
    x, items, first = signal(), [], 0
    while first < len(x):
        size = sizes[len(items) % len(sizes)] if len(items) < 200 else 3000
        items.extend(blocks(x[first: first + size], size=size, first=first))
        first += size
    assert repr(watch(CONFIG, by_stamp(items, list(speeds(SPEED, SECONDS))))) == repr(REFERENCE)


@settings(max_examples=25, deadline=None)
@given(st.randoms(use_true_random=False))
def test_interleaving_does_not_matter(random: object) -> None:
    queues = [list(blocks(signal())), list(speeds(SPEED, SECONDS))]
    items = []
    while any(queues):
        lag = [q[0].stamp_ns for q in queues if q]
        behind = [q for q in queues if q and q[0].stamp_ns < min(lag) + 300_000_000]
        items.append(random.choice(behind).pop(0))
    assert repr(watch(CONFIG, items)) == repr(REFERENCE)


def test_state_is_not_changed_by_update() -> None:
    items = by_stamp(list(blocks(signal())), list(speeds(SPEED, SECONDS)))
    state = initial(CONFIG)
    for item in items[: len(items) // 2]:
        state, _ = update(CONFIG, state, item)
    runs = []
    for _ in range(2):
        now, found = state, []
        for item in items[len(items) // 2:]:
            now, verdicts = update(CONFIG, now, item)
            found.extend(verdicts)
        runs.append(repr(found + list(finish(CONFIG, now)[1])))
    assert runs[0] == runs[1]
