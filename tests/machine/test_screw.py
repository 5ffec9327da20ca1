"""Twists, exponentials and the Paden-Kahan subproblems against series, closed forms and the printed equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from turnmill_core.machine import screw

RNG = np.random.default_rng(31)


@pytest.fixture(autouse=True)
def _seed() -> None:
    """The same random numbers for a test, whichever tests run before it."""
    RNG.bit_generator.state = np.random.default_rng(31).bit_generator.state


def directions(n: int) -> np.ndarray:
    return screw.unit(RNG.normal(size=(n, 3)))


def matrix(twist: np.ndarray) -> np.ndarray:
    out = np.zeros((4, 4))
    out[:3, :3], out[:3, 3] = screw.hat(twist[3:]), twist[:3]
    return out


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, -2.0, math.pi, 7.0])
def test_exponentials_equal_the_matrix_exponential(angle: float) -> None:
    for w, q in zip(directions(5), RNG.normal(size=(5, 3)), strict=True):
        twist = screw.revolute(w, q)
        assert screw.exponential(twist, angle) == pytest.approx(expm(matrix(twist) * angle), abs=2e-13)
        twist = screw.prismatic(w)
        assert screw.exponential(twist, angle) == pytest.approx(expm(matrix(twist) * angle), abs=2e-13)


def test_a_screw_with_pitch_moves_along_its_axis() -> None:
    w, q, pitch = directions(1)[0], np.array([0.1, -0.2, 0.3]), 0.05
    twist = screw.revolute(w, q) + np.concatenate([pitch * w, np.zeros(3)])
    moved = screw.exponential(twist, 2 * math.pi) @ np.append(q, 1)
    assert moved[:3] == pytest.approx(q + 2 * math.pi * pitch * w, abs=1e-14)


def test_points_on_the_axis_stay_and_motions_undo_themselves() -> None:
    w, q = directions(1)[0], np.array([0.3, 0.1, -0.4])
    g = screw.exponential(screw.revolute(w, q), np.linspace(-4, 4, 7))
    assert g @ np.append(q + 0.7 * w, 1) == pytest.approx(np.tile(np.append(q + 0.7 * w, 1), (7, 1)), abs=1e-15)
    assert screw.inverse_motion(g) @ g == pytest.approx(np.tile(np.eye(4), (7, 1, 1)), abs=1e-15)
    assert np.linalg.det(g[:, :3, :3]) == pytest.approx(np.ones(7), abs=1e-14)


def test_subproblem_1_returns_the_angle() -> None:
    for w in directions(20):
        u, angle = RNG.normal(size=3), RNG.uniform(-math.pi, math.pi)
        assert screw.subproblem_1(w, u, screw.rotation(w, angle) @ u) == pytest.approx(angle, abs=1e-14)


def printed_k3(w1: np.ndarray, w2: np.ndarray, u: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
    """Eq. 3.12 with erratum K1, as printed: k1, k2, k3."""
    c = w1 @ w2
    k1 = (c * (w2 @ u) - w1 @ v) / (c * c - 1)
    k2 = (c * (w1 @ v) - w2 @ u) / (c * c - 1)
    return k1, k2, math.sqrt((u @ u - k1**2 - k2**2 - 2 * k1 * k2 * c) / np.linalg.norm(np.cross(w1, w2)) ** 2)


def test_subproblem_2_solves_for_any_two_axes_and_agrees_with_the_printed_root() -> None:
    for w1, w2 in zip(directions(200), directions(200), strict=True):
        u = RNG.normal(size=3)
        t = RNG.uniform(-math.pi, math.pi, 2)
        v = screw.rotation(w1, t[0]) @ screw.rotation(w2, t[1]) @ u
        found = screw.subproblem_2(w1, w2, u, v)
        for t1, t2 in found:
            assert screw.rotation(w1, t1) @ screw.rotation(w2, t2) @ u == pytest.approx(v, abs=1e-12)
        off = [max(abs(math.remainder(a - b, 2 * math.pi)) for a, b in zip(pair, t, strict=True)) for pair in found]
        assert min(off) < 1e-6  # the given pair is one of the two; digits are lost only where they meet
        k1, k2, k3 = printed_k3(w1, w2, u, v)
        z = screw.rotation(w2, found[0, 1]) @ u
        assert z == pytest.approx(k1 * w1 + k2 * w2 + k3 * np.cross(w1, w2), abs=1e-6)


def test_angles_keep_their_digits_next_to_the_first_axis() -> None:
    """The printed root gives only half of the digits here."""
    w1, w2, u = np.eye(3)[2], np.eye(3)[1], np.eye(3)[2]
    for b in (1e-3, 1e-6, 1e-9, 1e-11):
        v = screw.rotation(w1, 0.4) @ screw.rotation(w2, b) @ u
        t1, t2 = screw.subproblem_2(w1, w2, u, v)[1]
        assert t2 == pytest.approx(b, rel=1e-12)
        assert t1 == pytest.approx(0.4, abs=1e-12)
    assert abs(printed_k3(w1, w2, u, v)[2] / b - 1) > 1e-3


def test_what_cannot_be_reached_is_said() -> None:
    w1, w2 = np.eye(3)[2], screw.unit([0.0, 1.0, 1.0])
    with pytest.raises(ValueError, match=r"point 1.*cannot be reached.*45 deg apart"):
        screw.subproblem_2(w1, w2, np.eye(3)[2], np.array([[0.0, 0, 1], [0, 0, -1], [0, 0, -1]]))
    with pytest.raises(ValueError, match="not zero"):
        screw.unit([0.0, 0.0, 0.0])
