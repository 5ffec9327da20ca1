"""Process damping coefficients and the low-speed envelope."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stability.cases import textbook
from turnmill_core.operation_stability import ProcessDamping, flank_contact_length
from turnmill_core.stability.collocation import leading_multiplier
from turnmill_core.stability.low_speed import (
    Envelope,
    envelope_depth,
    envelope_from_tests,
)

RPM = np.pi / 30


def test_contact_length_of_the_thesis() -> None:
    """Erratum D6: 60 um hone, 50 degrees separation, 5 degrees clearance give 294 um."""
    assert flank_contact_length(60e-6, np.radians(50), np.radians(5)) == pytest.approx(294e-6, rel=3e-3)


def test_envelope_of_the_two_tests_of_the_thesis() -> None:
    """Erratum D5; 8 of 20 mm immersion is below 0.6."""
    found = envelope_from_tests((2070 * RPM, 0.4e-3), (1625 * RPM, 0.5e-3), 0.4)
    assert found.depth_limit == pytest.approx(0.2312e-3, rel=1e-3)
    assert found.asymptotic_speed / RPM == pytest.approx(873.7, rel=1e-3)
    assert not found.valid
    assert envelope_from_tests((2070 * RPM, 0.4e-3), (1625 * RPM, 0.5e-3), 0.8).valid


@given(st.floats(1e-4, 1e-2), st.floats(10.0, 300.0), st.floats(1.1, 3.0), st.floats(1.1, 3.0))
def test_the_envelope_returns_its_tests(limit: float, speed: float, near: float, far: float) -> None:
    true = Envelope(limit, speed, True)
    tests = [(s, float(envelope_depth(true, s))) for s in (speed * near, speed * near * far)]
    found = envelope_from_tests(tests[0], tests[1], 1.0)
    assert found.depth_limit == pytest.approx(limit, rel=1e-6)
    assert found.asymptotic_speed == pytest.approx(speed, rel=1e-6)
    assert envelope_depth(found, 0.9 * speed) == np.inf


@pytest.mark.parametrize(("first", "second"), [
    ((200.0, 1e-3), (100.0, 0.5e-3)), ((200.0, 1e-3), (200.0, 2e-3)), ((0.0, 1e-3), (100.0, 2e-3)),
    ((200.0, np.nan), (100.0, 2e-3)),
])
def test_impossible_tests_are_refused(first: tuple[float, float], second: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="test"):
        envelope_from_tests(first, second, 1.0)


@pytest.mark.parametrize("call", [
    lambda: ProcessDamping(1e13, 3e-4).coefficient(0.0), lambda: ProcessDamping(-1.0, 3e-4),
    lambda: ProcessDamping(1e13, 0.0), lambda: ProcessDamping(1e13, 3e-4, -0.1),
    lambda: flank_contact_length(0.0, 1.0, 0.1), lambda: flank_contact_length(6e-5, 1.0, 0.0),
])
def test_impossible_flanks_are_refused(call: object) -> None:
    with pytest.raises(ValueError, match="expected"):
        call()  # type: ignore[operator]


def test_damping_lifts_the_limit_more_at_lower_speed() -> None:
    """The same flank: damping 1/V against the cut, so the limit bends upward towards low speed."""
    def gain(rpm: float) -> float:
        damping = ProcessDamping(2e12, 60e-6).coefficient(5e-3 * rpm * RPM)
        bare, damped = (abs(leading_multiplier(textbook(0.15e-3, rpm=rpm, process_damping=d)))
                        for d in ((0.0, 0.0), (damping, 0.3)))
        return float(np.log(bare / damped) / textbook(1e-3, rpm=rpm).period)

    assert gain(1500.0) > 1.5 * gain(3000.0) > 0
