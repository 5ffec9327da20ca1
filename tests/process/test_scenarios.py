"""What the shipped recordings contain, by the noise-free truth."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from tests.process.cases import samples
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.scenarios import SCENARIOS
from turnmill_core.process.simulation import simulate
from turnmill_core.process.truth import Truth, crossings, join_truth


def operation(name: str) -> Operation:
    path = {p.name: p for p in shipped_operations().values()}[SCENARIOS[name].operation]
    return read_operation(path)


@lru_cache
def result(name: str) -> tuple[np.ndarray, Truth]:
    scenario = SCENARIOS[name]
    chunks = list(simulate(operation(name), scenario.config, scenario.seed, duration=scenario.duration))
    return samples(chunks), join_truth(chunk.truth for chunk in chunks)


@pytest.mark.parametrize("name", SCENARIOS)
def test_duration_and_size(name: str) -> None:
    scenario = SCENARIOS[name]
    found, _ = result(name)
    assert len(found) == scenario.duration * 12800
    assert found.shape[1] == len(scenario.config.channels) == 2
    assert len(found) * 2 * 4 < 2e6
    assert np.all(np.isfinite(found))


def test_the_demo_goes_from_air_to_stable_to_hopf_to_stable() -> None:
    _, truth = result("demo")
    onset, rescue = crossings(truth)
    assert onset.rising
    assert not rescue.rising
    assert 5.0 < onset.time < 6.0
    assert 9.0 < rescue.time < 9.4
    ratio, time = truth.ratio, truth.time
    assert not truth.touched[time < 1.4].any()
    assert truth.in_cut[time > 1.9].all()
    for start, stop in ((2.0, 4.9), (9.5, 13.0)):
        assert ratio[(time > start) & (time < stop)].max() < 0.05
    chatter = (time > 6.2) & (time < 8.8)
    assert ratio[chatter].min() > 3
    np.testing.assert_allclose(truth.frequency[chatter], 778.05, rtol=1e-3)


def test_hopf_is_far_from_the_harmonics_of_the_spindle() -> None:
    _, truth = result("demo")
    frequency = truth.frequency[(truth.time > 6.2) & (truth.time < 8.8)].mean()
    assert 0.3 < (frequency / (3025 / 60)) % 1 < 0.7


@pytest.mark.parametrize("name", ["flip_3_teeth", "flip_2_teeth"])
def test_flip_is_period_two_in_the_signal(name: str) -> None:
    """Lines at odd multiples of half the tooth passing frequency, and nothing that is asynchronous."""
    found, truth = result(name)
    late = truth.time > 3.5
    assert (truth.half_order[late] / truth.synchronous[late]).min() > 0.9
    assert truth.ratio[late].max() < 0.01
    early = (truth.time > 1.1) & (truth.time < 1.9)
    assert (truth.half_order[early] / truth.synchronous[early]).max() < 0.01
    tail = found[-12800 * 6 // 5 :, 1]
    spectrum = np.abs(np.fft.rfft((tail - tail.mean()) * np.hanning(len(tail))))
    frequency = np.argmax(spectrum) * 12800 / len(tail)
    assert frequency == pytest.approx(262.5, abs=1)


def test_runout_alone_looks_like_flip() -> None:
    """The same line as in flip chatter with two teeth, from the first contact on, in a stable cut."""
    _, truth = result("runout_2_teeth")
    cut = truth.time > 1.0
    assert (truth.half_order[cut] / truth.synchronous[cut]).min() > 0.9
    assert truth.ratio[cut].max() < 0.01
    assert crossings(truth) == ()


def test_air_is_air() -> None:
    found, truth = result("air")
    assert not truth.touched.any()
    assert np.all(truth.synchronous == 0)
    assert 0.005 < found[:, 0].std() < 0.05


@pytest.mark.parametrize("name", shipped_operations())
def test_every_shipped_operation_can_be_simulated(name: str) -> None:
    """Rigid ones too; the samples are finite and a force is there where the tool cuts. Modes that turn are refused."""
    op = replace(read_operation(shipped_operations()[name]), schedule=())
    config = SimulationConfig(channels=("sound", "tool_x", "workpiece_y", "force_y"), force_noise=0.0)
    if "rotating" in (op.tool.structure.frame, op.workpiece.structure.frame):
        with pytest.raises(ValueError, match="do not turn"):
            next(simulate(op, config, 0, duration=0.2))
        return
    found = samples(list(simulate(op, config, 0, duration=0.2)))
    assert np.all(np.isfinite(found))
    largest = np.abs(found[:, 3]).max()
    assert largest > 2 if op.conditions.depth > 0 else largest == 0
