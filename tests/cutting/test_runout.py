"""Half-order lines of the force of runout alone: limits, a closed form, and the simulation in time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.process.cases import ALUMINIUM, RPM, STIFF, exact_config, milling, run, turn_milling
from turnmill_core.cutting.runout import half_order_share
from turnmill_core.operation import Mode, Operation

SPAN = (-1e-3, 4e-3)
SOFT = (Mode(700.0, 0.03, 0.8, (1.0, 0.0, 0.0)), Mode(820.0, 0.03, 0.8, (0.0, 1.0, 0.0)))


def cut(runout: tuple[float, ...], teeth: int = 2, modes: tuple[Mode, ...] = STIFF, **other: object) -> Operation:
    return milling(modes, teeth=teeth, span=SPAN, runout=runout, **other)  # type: ignore[arg-type]


def share(op: Operation, highest: float = math.inf) -> float:
    return half_order_share(op, op.conditions, min(highest, 1e9))


@pytest.mark.parametrize(("teeth", "runout"), [(2, ()), (2, (0.0, 0.0)), (3, (1e-5, 0.0, -1e-5))])
def test_nothing_is_known_without_a_runout_or_needed_with_an_odd_number_of_teeth(
        teeth: int, runout: tuple[float, ...]) -> None:
    assert math.isnan(share(cut(runout, teeth)))


def test_nothing_is_known_out_of_the_cut_or_of_uneven_pitch() -> None:
    op = cut((1e-5, -1e-5))
    assert math.isnan(half_order_share(op, replace(op.conditions, depth=-1e-3)))
    assert math.isnan(share(cut((1e-5, -1e-5), pitch_angles=(math.pi - 0.2, math.pi + 0.2))))


@pytest.mark.parametrize("runout", [(1e-5, 1e-5, 1e-5, 1e-5), (1e-5, 0.0, -1e-5, 0.0)])
def test_no_half_order_lines_where_tooth_steps_do_not_alternate(runout: tuple[float, ...]) -> None:
    """Teeth all longer by the same, and an eccentric tool of four teeth."""
    assert share(cut(runout, 4)) < 1e-20


@pytest.mark.parametrize("teeth", [2, 4, 6])
def test_doubled_runout_gives_four_times_the_energy(teeth: int) -> None:
    """While every tooth stays in the cut the chip is linear in the runout, and tooth passing lines keep theirs."""
    once, twice = (share(cut(tuple(k * 2e-6 * (-1) ** j for j in range(teeth)), teeth, feed=2e-4)) for k in (1, 2))
    assert twice / (1 - twice) == pytest.approx(4 * once / (1 - once), rel=1e-6)


def test_force_of_two_straight_teeth_in_closed_form() -> None:
    """One tooth in the cut at a time: the chip is f sin(phi) +- 2 r, and Parseval gives both energies."""
    r, feed = 5e-6, 1e-4
    op = cut((r, -r), feed=feed)
    start, end = math.acos(SPAN[1] / 5e-3), math.acos(SPAN[0] / 5e-3)
    width = (end - start) / 20000
    phi = start + width * (np.arange(20000) + 0.5)
    expected = []
    for direction in (-ALUMINIUM.Krc * np.sin(phi) - ALUMINIUM.Ktc * np.cos(phi),
                      -ALUMINIUM.Krc * np.cos(phi) + ALUMINIUM.Ktc * np.sin(phi)):
        odd, even = 2 * r * direction, feed * np.sin(phi) * direction
        power = [float(np.sum(x**2)) * width / math.pi for x in (odd, even)]
        expected.append(power[0] / (sum(power) - (float(even.sum()) * width / math.pi) ** 2))
    assert share(op) == pytest.approx(max(expected), rel=0.01)


@pytest.mark.parametrize("op", [
    cut((6e-6, -6e-6), modes=SOFT, speed=6300 * RPM, depth=4e-5), cut((6e-6, 2e-6, 5e-6, -5e-6), 4, SOFT, depth=4e-5),
    turn_milling(SOFT, depth=4e-5, runout=(8e-6, -8e-6)),
], ids=["2 teeth", "4 teeth", "turn-milling"])
def test_stable_cut_simulated_in_time_has_this_share(op: Operation) -> None:
    """Equations of motion with regeneration and loss of contact, far below the depth limit."""
    speed, last, per_turn = op.conditions.tool_speed, 4, 1800
    turn = 2 * math.pi / speed
    rate = round(per_turn / turn)
    found = run(op, exact_config(rate, ("force_x", "force_y")), 40 * turn)
    at = (36 * per_turn + np.arange(last * per_turn)) * rate * turn / per_turn
    whole = np.stack([np.interp(at, np.arange(len(found)), x) for x in found.T])
    count = int(5000 * turn)
    power = np.abs(np.fft.rfft(whole)[:, ::last][:, : count + 1]) ** 2
    half = power[:, op.tool.teeth // 2:: op.tool.teeth].sum(axis=1) / power[:, 1:].sum(axis=1)
    assert share(op, 5000.0) == pytest.approx(half.max(), rel=0.05)
