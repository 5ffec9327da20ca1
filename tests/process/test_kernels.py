"""The compiled loops against their plain versions and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.process.cases import BENCHMARK_MODE, exact_config, milling, samples, turn_milling
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Mode, Operation
from turnmill_core.process._kernels import filters, integrator, interpolation
from turnmill_core.process.model import knot, process_model
from turnmill_core.process.simulation import initial, step

RUNOUT = (2e-5, -1e-5, 0.0)
CASES = {
    "milling, helix, runout": milling(teeth=3, depth=3e-3, helix_angle=0.5, runout=RUNOUT),
    "turn-milling, workpiece mode": turn_milling(
        (Mode(782.0, 0.02, 0.2, (1.0, 0.0, 0.0)),), depth=4e-3,
        workpiece_modes=(Mode(500.0, 0.02, 0.2, (0.6, 0.8, 0.2)),), helix_angle=-0.4),
}


@pytest.mark.parametrize("name", CASES)
def test_the_compiled_integrator_is_the_plain_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All functions uncompiled against all compiled, in a violent cut; to round-off (fused multiply-add)."""
    op = CASES[name]
    model = process_model(op, exact_config(40_000))
    knots = np.array([knot(model, axis_state_at(op, t, round(t * 1e9)), 0) for t in (0.0, 0.004, 0.008)])

    def advance(function: object) -> list[np.ndarray]:
        count = 320
        modal = np.zeros((len(model.modes), 2))
        modal[:, 0] = 1e-5
        state = [modal, np.zeros(integrator.LOADS), np.array([0.0, 0.0, knots[0, integrator.DEPTH], 0.0, 1.0]),
                 np.zeros((model.teeth, model.slices, model.cells, 2)), np.empty((count, len(integrator.RAW)))]
        marks = np.zeros((2000, 4))
        written = function(0, model.dt, knots, np.zeros((0, 0, 0, 2)), model.modes, model.tooth_angle, model.pitch,  # type: ignore[operator]
                           model.runout, model.shape, model.coefficients, True, *state, 240, marks)
        assert written > 0
        return [*state, marks]

    compiled = advance(integrator.advance)
    for module, inner in ((interpolation, "ramp"), (interpolation, "ramp_integral"), (integrator, "past"),
                          (integrator, "surface_at"), (integrator, "hermite"), (integrator, "_cut"),
                          (integrator, "_leave_surface"), (integrator, "_move")):
        monkeypatch.setattr(module, inner, getattr(module, inner).py_func)
    plain = advance(integrator.advance.py_func)
    assert np.abs(plain[4][:, 8]).max() > 1
    for a, b in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12 * max(1e-6, float(np.abs(b).max())))


def test_free_decay_is_the_closed_form() -> None:
    """Above the workpiece a mode decays as exp(-zeta w t) cos(w_d t + ...), exactly."""
    mode = BENCHMARK_MODE
    op: Operation = milling((mode,), depth=-1e-3)
    config = exact_config(20_000)
    start = np.array([[3e-6, 0.02]])
    state = initial(op, config, 0, start)
    blocks = []
    for k in range(60):
        state, chunk = step(config, state, [axis_state_at(op, 0.004 * k, 4_000_000 * k)])
        blocks.append(chunk)
    found = samples(blocks)[:, 0]
    t = np.arange(len(found)) / 20_000
    w = 2 * math.pi * mode.frequency
    wd = w * math.sqrt(1 - mode.damping**2)
    decay = np.exp(-mode.damping * w * t)
    expected = decay * (3e-6 * np.cos(wd * t) + (0.02 + mode.damping * w * 3e-6) / wd * np.sin(wd * t))
    assert len(found) > 4000
    np.testing.assert_allclose(found, expected, atol=2e-7 * 3e-6)  # samples are float32


def test_a_force_linear_in_time_moves_a_mode_exactly() -> None:
    """Transition over a step against the closed form for an undamped-like ramp f(t) = s t."""
    mode = Mode(300.0, 1e-9, 2.0, (1.0, 0.0, 0.0))
    model = process_model(milling((mode,)), exact_config(5000))
    row, dt, slope, w = model.modes[0], model.dt, 7.0, 2 * math.pi * 300.0
    q = row[integrator.C1] * slope * dt
    v = row[integrator.C2] * slope * dt
    assert q == pytest.approx(slope / mode.stiffness * (dt - math.sin(w * dt) / w), rel=1e-6)
    assert v == pytest.approx(slope / mode.stiffness * (1 - math.cos(w * dt)), rel=1e-6)
    assert row[integrator.B1] + row[integrator.C1] == pytest.approx((1 - math.cos(w * dt)) / mode.stiffness, rel=1e-6)


def test_decimation_is_a_convolution() -> None:
    rows = np.random.default_rng(1).normal(size=(3, 400))
    taps = np.hanning(41)
    phases = np.ascontiguousarray(rows.reshape(3, 100, 4).transpose(0, 2, 1))
    out = np.full((3, 90), np.nan)
    filters.decimate(phases, taps, out)
    expected = np.stack([np.convolve(row, taps, "valid")[::4][:90] for row in rows])
    np.testing.assert_allclose(out, expected, atol=1e-12)
    plain = np.empty_like(out)
    filters.decimate.py_func(phases, taps, plain)
    np.testing.assert_allclose(out, plain, atol=1e-13)


def test_first_order_noise_is_a_recursive_filter() -> None:
    white = np.random.default_rng(2).normal(size=300)
    out = np.empty(300)
    last = filters.first_order(white, 0.9, 0.4, out)
    expected = lfilter([1.0], [1.0, -0.9], white, zi=np.array([0.9 * 0.4]))[0]
    np.testing.assert_allclose(out, expected, atol=1e-12)
    assert last == out[-1] == filters.first_order.py_func(white, 0.9, 0.4, np.empty(300))


@pytest.mark.parametrize("u", [-1.5, -1.0, -0.3, 0.0, 0.4, 1.0, 2.0])
def test_edges_are_averaged_with_a_hat(u: float) -> None:
    s = np.linspace(-1, 1, 200_001)
    expected = float(np.mean((1 - np.abs(s)) * (u + s >= 0)) * 2)
    assert interpolation.ramp.py_func(u) == interpolation.ramp(u) == pytest.approx(expected, abs=1e-4)


def test_the_surface_is_read_as_a_cubic() -> None:
    """Four-point Lagrange interpolation is exact for a cubic, and wraps around."""
    t = np.arange(40.0)
    rows = np.stack([1 + 0.1 * t + 0.02 * t**2 - 0.001 * t**3, 0.5 * t], axis=1)
    for position in (3.25, 17.5, 36.9):
        expected = 0.6 * (1 + 0.1 * position + 0.02 * position**2 - 0.001 * position**3) + 0.8 * 0.5 * position
        assert interpolation.surface_at(rows, position, 0.6, 0.8) == pytest.approx(expected, rel=1e-12)
        assert interpolation.surface_at.py_func(rows, position + 400, 0.6, 0.8) == pytest.approx(expected, rel=1e-9)
    periodic = np.stack([np.sin(2 * np.pi * t / 40), np.zeros(40)], axis=1)
    expected = math.sin(2 * math.pi * 39.6 / 40)
    assert interpolation.surface_at(periodic, 39.6, 1.0, 0.0) == pytest.approx(expected, abs=1e-4)
