"""Process damping coefficients and the low-speed envelope."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.stability.cases import TEXTBOOK, textbook
from turnmill_core.operation import Mode, Structure
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_stability import ProcessDamping, flank_contact_length
from turnmill_core.stability.collocation import leading_multiplier
from turnmill_core.stability.low_speed import (
    Envelope,
    average_envelope,
    envelope_depth,
    envelope_from_tests,
    low_speed_limits,
    mean_eigenvalue,
    ploughing_coefficient,
)
from turnmill_core.structure.modal import modal_model, state_space

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


FLANK = ProcessDamping(1e14, 60e-6)
LIGHT = Mode(922.0, 0.002, 0.03993, (1, 0, 0))


def lowest_share(average: Envelope, rpm: float, flank: ProcessDamping | None) -> float:
    """Smallest limit over the envelope within one lobe around `rpm`, four straight teeth in a slot; inf without one."""
    modes = Structure((LIGHT, dataclasses.replace(LIGHT, shape=(0, 1, 0))))
    structure = state_space(modal_model(modes, Structure()))

    def unstable(depth: float, speed: float) -> bool:
        damping = (0.0, 0.0) if flank is None else (flank.coefficient(5e-3 * speed * RPM), 0.0)
        problem = textbook(depth, rpm=speed, teeth=4, process_damping=damping).at(structure=structure)
        return abs(leading_multiplier(problem)) > 1

    lobe, found = rpm * rpm / (922 * 60 / 4), np.inf
    for speed in rpm + lobe * np.linspace(-0.5, 0.5, 41):
        envelope = min(float(envelope_depth(average, speed * RPM)), 5 * average.depth_limit)
        low, high = 0.0, min(found, 5.0)
        if not unstable(high * envelope, speed):
            continue
        for _ in range(10):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if unstable(middle * envelope, speed) else (middle, high)
        found = high
    return found


def test_the_asymptote_of_the_average_model_holds_against_the_solver() -> None:
    """Full immersion, one symmetric mode (Eq. 4.119): no chatter below it, the envelope above it."""
    average = average_envelope(LIGHT, 4, 5e-3, (600e6, 200e6), np.pi, FLANK)
    rpm = average.asymptotic_speed / RPM
    assert rpm == pytest.approx(1616, abs=1)
    assert lowest_share(average, 0.9 * rpm, FLANK) == np.inf
    for factor in (1.4, 2.0, 4.0):
        assert lowest_share(average, factor * rpm, FLANK) == pytest.approx(1.0, abs=0.02)


def test_without_process_damping_the_undamped_limit_returns() -> None:
    for flank in (None, ProcessDamping(1e6, 60e-6)):
        average = average_envelope(LIGHT, 4, 5e-3, (600e6, 200e6), np.pi, flank)
        assert average.asymptotic_speed < 1e-4
        assert lowest_share(average, 5000.0, flank) == pytest.approx(1.0, abs=0.02)


def test_the_ploughing_coefficient_returns_the_flank() -> None:
    average = average_envelope(TEXTBOOK, 4, 5e-3, (600e6, 200e6), 2.4, FLANK)
    found = ploughing_coefficient(average, TEXTBOOK.frequency, (600e6, 200e6), 2.4, 10e-3)
    assert found == pytest.approx(FLANK.coefficient(1.0), rel=1e-12)


@pytest.mark.parametrize("arc", [0.3, 1.3694, 2.5, np.pi])
def test_eigenvalue_of_the_mean_matrix(arc: float) -> None:
    """Against the matrix of Eq. 4.110, integrated numerically."""
    phi = np.linspace(0, arc, 20001)
    n, t = np.stack([np.sin(phi), np.cos(phi)]), np.stack([-np.cos(phi), np.sin(phi)])
    values = np.einsum("ik,jk->ijk", -0.3 * n + t, n)
    matrix = np.trapezoid(values, phi, axis=2)
    expected = np.linalg.eigvals(matrix)
    assert np.min(np.abs(expected - mean_eigenvalue(0.3, arc))) < 1e-6


def test_three_curves_of_figure_4_64() -> None:
    """Damped limits lie above undamped ones; the envelope is that of the two tests, with a warning."""
    op = read_operation(shipped_operations()["thesis_table_4_11"])
    found = low_speed_limits(op, np.array([1200.0, 2070.0]) * RPM, 6e-3)
    assert np.all(found.damped >= found.undamped * (1 - 1e-3))
    assert found.envelope is not None
    assert found.envelope.depth_limit == pytest.approx(0.2312e-3, rel=1e-3)
    assert "below 0.6" in found.warning
    assert 1e5 < found.ploughing < 1e7


def test_low_speed_needs_process_damping() -> None:
    op = read_operation(shipped_operations()["thesis_table_4_9"])
    with pytest.raises(ValueError, match="process damping"):
        low_speed_limits(op, [300.0], 1e-3)
