"""States of analytic signals whose truth is known by construction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.monitoring.signals import (
    RATE,
    blocks,
    by_stamp,
    comb,
    flip,
    hopf,
    judged,
    noise,
    phase,
    speeds,
    watch,
)
from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.decision import CHATTER
from turnmill_core.monitoring.verdict import ChatterKind, Reason, SpeedSource, Verdict
from turnmill_core.prediction import PredictedType, Prior

RPM = 2 * math.pi / 60


def settled(verdicts: list[Verdict]) -> list[Verdict]:
    """Verdicts after warming up and the first dwell."""
    return [v for v in verdicts if v.window_end_ns > 0.75e9]


def states(verdicts: list[Verdict]) -> set[ChatterKind]:
    return {v.state for v in settled(verdicts)}


@pytest.mark.parametrize("teeth", [1, 2, 3, 4, 5, 6, 12])
@pytest.mark.parametrize("rpm", [2000, 3350, 9000])
def test_stable_cut_and_air(teeth: int, rpm: float) -> None:
    t = phase(rpm * RPM, 1.5)
    n = noise(len(t), 0.1, teeth)
    assert states(judged(n, teeth, rpm * RPM)) == {ChatterKind.AIR}
    assert states(judged(comb(t, teeth) + n, teeth, rpm * RPM)) == {ChatterKind.STABLE}


@pytest.mark.parametrize("teeth", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("amplitude", [0.3, 1.0])
def test_hopf_with_its_frequency_and_family(teeth: int, amplitude: float) -> None:
    rpm = 3350
    t = phase(rpm * RPM, 1.5)
    x = comb(t, teeth) + hopf(t, teeth, 871.3, amplitude) + noise(len(t), 0.1, teeth)
    verdicts = settled(judged(x, teeth, rpm * RPM))
    assert {v.state for v in verdicts} == {ChatterKind.HOPF}
    tooth = teeth * rpm / 60
    for v in verdicts:
        assert v.chatter_frequency == pytest.approx(871.3, rel=0.001)
        assert v.tooth_passing_frequency == pytest.approx(tooth, rel=1e-3)
        assert {round((f - v.chatter_frequency) / tooth, 1) for f in v.chatter_family} >= {-1.0, 0.0, 1.0}
        energy = amplitude**2 / 2 * (1 + 2 * 0.2**2)
        comb_energy = sum(0.5 / k**2 for k in range(1, 11))
        assert v.asynchronous_ratio == pytest.approx(energy / (energy + comb_energy), rel=0.15)


@pytest.mark.parametrize("teeth", [1, 3, 5])
def test_flip_with_an_odd_number_of_teeth(teeth: int) -> None:
    t = phase(3350 * RPM, 1.5)
    verdicts = settled(judged(comb(t, teeth) + flip(t, teeth, 0.5) + noise(len(t), 0.1, 3), teeth, 3350 * RPM))
    assert {v.state for v in verdicts} == {ChatterKind.FLIP}
    tooth = teeth * 3350 / 60
    assert verdicts[-1].chatter_frequency == pytest.approx(3.5 * tooth, rel=1e-3)
    assert {round(f / tooth % 1, 2) for f in verdicts[-1].chatter_family} == {0.5}
    assert verdicts[-1].asynchronous_ratio < 0.01


@pytest.mark.parametrize("teeth", [2, 4, 6])
def test_flip_or_runout_with_an_even_number_of_teeth_is_decided_by_the_prior_only(teeth: int) -> None:
    speed = 3350 * RPM
    t = phase(speed, 1.5)
    x = comb(t, teeth) + flip(t, teeth, 0.5) + noise(len(t), 0.1, 3)
    items = by_stamp(list(blocks(x)), list(speeds(speed, 1.5)))
    config = ChatterConfig(teeth=teeth, nominal_speed=speed)
    expected = {None: (ChatterKind.FLIP_OR_RUNOUT, Reason.NO_PRIOR),
                PredictedType.FLIP: (ChatterKind.FLIP, Reason.PRIOR_FLIP),
                PredictedType.STABLE: (ChatterKind.STABLE, Reason.PRIOR_RUNOUT)}
    for kind, (state, reason) in expected.items():
        prior = None if kind is None else Prior(0, kind, 1.1)
        last = watch(config, [*([prior] if prior else []), *items])[-1]
        assert (last.state, last.reason, last.prior) == (state, reason, prior)


def test_runout_of_two_teeth_has_the_lines_of_flip() -> None:
    t = phase(3350 * RPM, 1.5)
    x = comb(t, 2, runout=0.4) + noise(len(t), 0.1, 3)
    assert states(judged(x, 2, 3350 * RPM)) == {ChatterKind.FLIP_OR_RUNOUT}


@pytest.mark.parametrize("teeth", [3, 4, 5, 6])
def test_runout_of_more_teeth_is_no_chatter(teeth: int) -> None:
    t = phase(3350 * RPM, 1.5)
    x = comb(t, teeth, runout=0.4) + noise(len(t), 0.1, 3)
    assert states(judged(x, teeth, 3350 * RPM)) == {ChatterKind.STABLE}


def test_variable_pitch_has_families_at_the_spindle_frequency() -> None:
    t = phase(3350 * RPM, 1.5)
    x = comb(t, 4, runout=0.5) + hopf(t, 1, 871.3, 0.6) + noise(len(t), 0.05, 3)
    verdicts = settled(judged(x, 4, 3350 * RPM, equal_pitch=False))
    assert {v.state for v in verdicts} == {ChatterKind.HOPF}
    assert verdicts[-1].tooth_passing_frequency == pytest.approx(4 * 3350 / 60, rel=1e-3)
    assert np.diff(verdicts[-1].chatter_family)[:2] == pytest.approx(3350 / 60, rel=0.02)
    assert states(judged(comb(t, 4, runout=0.5) + noise(len(t), 0.05, 3), 4, 3350 * RPM,
                         equal_pitch=False)) == {ChatterKind.STABLE}


def test_resonance_of_a_tooth_harmonic_is_no_chatter() -> None:
    t = phase(3350 * RPM, 2.0)
    x = comb(t, 4) + 4 * np.cos(2 * math.pi * 16 * t) + noise(len(t), 0.1, 3)
    assert states(judged(x, 4, 3350 * RPM)) == {ChatterKind.STABLE}


@pytest.mark.parametrize("error", [-2e-3, -1e-3, 5e-4, 2e-3])
def test_speed_error_of_the_axis_is_refined(error: float) -> None:
    speed = 3350 * RPM
    t = phase(speed * (1 + error), 1.5)
    items = by_stamp(list(blocks(comb(t, 4) + noise(len(t), 0.02, 1))), list(speeds(speed, 1.5)))
    verdicts = settled(watch(ChatterConfig(teeth=4, nominal_speed=speed), items))
    assert {v.state for v in verdicts} == {ChatterKind.STABLE}
    assert {v.spindle_speed_source for v in verdicts} == {SpeedSource.REFINED}
    assert verdicts[-1].spindle_speed == pytest.approx(speed * (1 + error), rel=1e-4)
    assert max(v.asynchronous_ratio for v in verdicts) < 1e-3


@pytest.mark.parametrize("error", [-0.017, 0.008, 0.017])
def test_nominal_speed_is_refined(error: float) -> None:
    speed = 3350 * RPM
    t = phase(speed * (1 + error), 2.0)
    verdicts = settled(judged(comb(t, 4) + noise(len(t), 0.1, 1), 4, speed, axes=False))
    assert {v.state for v in verdicts} == {ChatterKind.STABLE}
    assert verdicts[-1].spindle_speed == pytest.approx(speed * (1 + error), rel=2e-4)


@pytest.mark.parametrize("rate_rpm", [-500.0, 500.0])
def test_speed_ramp_of_500_rpm_per_second_is_followed(rate_rpm: float) -> None:
    seconds = 2.0
    at = np.arange(round(seconds * RATE)) / RATE
    speed = (3350 + rate_rpm * at) * RPM
    turns = (3350 * at + rate_rpm * at**2 / 2) / 60
    config = ChatterConfig(teeth=4, nominal_speed=3350 * RPM)
    given = list(speeds(speed, seconds))
    stable = settled(watch(config, by_stamp(list(blocks(comb(turns, 4) + noise(len(at), 0.05, 1))), given)))
    assert {v.state for v in stable} == {ChatterKind.STABLE}
    assert max(v.asynchronous_ratio for v in stable) < 0.01
    x = comb(turns, 4) + 0.5 * np.cos(2 * math.pi * 871.3 * at) + noise(len(at), 0.05, 1)
    chatter = settled(watch(config, by_stamp(list(blocks(x)), given)))
    hopfs = [v for v in chatter if v.state is ChatterKind.HOPF]
    assert len(hopfs) > 0.9 * len(chatter)
    assert [v.chatter_frequency for v in hopfs] == pytest.approx([871.3] * len(hopfs), rel=2e-3)


@pytest.mark.parametrize("frequencies", [(538.0,), (254.0, 269.0, 538.0, 772.0), (150.0, 449.0, 898.0)])
def test_machine_tones_out_of_the_cut_are_no_chatter(frequencies: tuple[float, ...]) -> None:
    at = np.arange(round(3 * RATE)) / RATE
    x = noise(len(at), 0.1, 5) + sum(0.06 * np.cos(2 * math.pi * f * at + f) for f in frequencies)
    for teeth in (2, 3, 4):
        verdicts = judged(x, teeth, 3350 * RPM)
        assert not [v for v in verdicts if v.state in CHATTER]
        assert verdicts[-1].state is ChatterKind.AIR


def test_growing_chatter_is_seen_within_300_ms_of_20_percent() -> None:
    speed = 3350 * RPM
    t = phase(speed, 5.0)
    at = np.arange(len(t)) / RATE
    amplitude = 0.005 * np.exp(np.clip(at - 1.0, 0, 1.2) * 4) * np.exp(-np.clip(at - 3.0, 0, None) * 12)
    x = comb(t, 4, harmonics=1) + amplitude * np.cos(2 * math.pi * 871.3 * at) + noise(len(t), 0.02, 2)
    verdicts = judged(x, 4, speed)
    chatter = [v.window_end_ns / 1e9 for v in verdicts if v.state is ChatterKind.HOPF]
    above = at[amplitude > 0.2]
    assert abs(chatter[0] - above[0]) < 0.3
    assert abs(chatter[-1] + 0.05 - above[-1]) < 0.3
    assert len(chatter) == round((chatter[-1] - chatter[0]) / 0.05) + 1


@pytest.mark.parametrize(("amplitude", "heard"), [(1.5, True), (0.5, False)])
def test_beside_a_tooth_harmonic_of_a_young_cut_only_what_is_far_louder_is_chatter(amplitude: float,
                                                                                 heard: bool) -> None:
    """5.5 Hz beside the third harmonic, whose amplitude is 1/3 and which is wide while a helical tool enters."""
    speed = 3350 * RPM
    t = phase(speed, 2.0)
    at = np.arange(len(t)) / RATE
    line = np.cos(2 * math.pi * (3 * 4 * 3350 / 60 + 5.5) * at)
    x = np.where(at > 0.8, comb(t, 4), 0) + np.where(at > 1.1, amplitude * line, 0) + noise(len(t), 0.02, 3)
    chatter = [v.window_end_ns / 1e9 for v in judged(x, 4, speed) if v.state is ChatterKind.HOPF]
    assert 1.1 < chatter[0] < 1.4 if heard else chatter[0] > 1.3
    assert chatter[-1] > 1.95


def test_a_chatter_keeps_its_name_while_a_sideband_is_stronger_and_loses_it_with_its_line() -> None:
    """The line at 871.3 Hz holds half the energy of its upper sideband from 1.5 to 2.5 s; both end at 3 s."""
    speed = 3350 * RPM
    t = phase(speed, 4.0)
    at = np.arange(len(t)) / RATE
    inside, tooth = (at > 0.8) & (at < 3.0), 4 * 3350 / 60
    upper = np.where((at > 1.5) & (at < 2.5), 1.2, 0.3)
    lines = np.cos(2 * math.pi * 871.3 * at) * np.where(upper > 1, 0.85, 1) + upper * np.cos(
        2 * math.pi * (871.3 + tooth) * at)
    verdicts = judged(comb(t, 4) + np.where(inside, lines, 0) + noise(len(t), 0.02, 4), 4, speed)
    named = [v.chatter_frequency for v in verdicts if v.state is ChatterKind.HOPF]
    assert len(named) > 40
    assert np.nanmax(np.abs(np.array(named) - 871.3)) < 2
    assert all(v.chatter_frequency in v.chatter_family for v in verdicts if v.chatter_family)
    held = [v for v in verdicts if v.state is ChatterKind.HOPF and v.reason is Reason.PERSISTENCE]
    assert all(math.isfinite(v.chatter_frequency) or not v.chatter_family for v in held)
    assert all(math.isnan(v.chatter_frequency) for v in verdicts if v.state is ChatterKind.STABLE)


def test_without_a_name_before_the_strongest_line_names_it() -> None:
    speed = 3350 * RPM
    t = phase(speed, 2.0)
    at = np.arange(len(t)) / RATE
    lines = np.cos(2 * math.pi * 871.3 * at) + 1.3 * np.cos(2 * math.pi * (871.3 + 4 * 3350 / 60) * at)
    verdicts = judged(comb(t, 4) + np.where(at > 0.8, lines, 0) + noise(len(t), 0.02, 4), 4, speed)
    named = [v.chatter_frequency for v in verdicts if v.state is ChatterKind.HOPF]
    assert np.nanmedian(named) == pytest.approx(871.3 + 4 * 3350 / 60, abs=1)
