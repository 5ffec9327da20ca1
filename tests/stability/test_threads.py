"""Threads of small linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from turnmill_core.stability import threads
from turnmill_core.stability.threads import one_thread


def counts() -> list[int]:
    """Threads of every OpenBLAS found."""
    return [get() for get, _ in threads._switches()]


def test_one_inside_and_the_former_number_afterwards() -> None:
    if not counts():
        pytest.skip("numpy and scipy brought no OpenBLAS here")
    before = counts()
    with one_thread():
        assert counts() == [1] * len(before)
        np.linalg.eigvals(np.eye(5))
    assert counts() == before
    with pytest.raises(ValueError, match="through"), one_thread():
        raise ValueError("through")
    assert counts() == before


def test_nothing_happens_without_a_switch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "_switches", lambda: ())
    with one_thread():
        assert np.linalg.eigvals(np.eye(2)).tolist() == [1, 1]
