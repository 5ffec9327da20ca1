"""The fast solver against published values, the extrapolated reference and itself at other resolutions."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from tests.stability.cases import PUBLISHED, textbook
from tests.stability.random_problems import random_problem
from turnmill_core.operation import Mode, Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.prediction import PredictedType
from turnmill_core.stability import semidiscretization
from turnmill_core.stability.collocation import (
    leading_multiplier,
    modal_blocks,
    period_map,
    series_multipliers,
    solve,
)
from turnmill_core.stability.operating_point import DepthFamily, depth_family
from turnmill_core.stability.problem import StabilityProblem
from turnmill_core.stability.search import stable_depths
from turnmill_core.structure.modal import LinearStructure
from turnmill_core.structure.rotating import rotating_structure

RPM = np.pi / 30


def radius(problem: StabilityProblem, base_nodes: float) -> float:
    """Spectral radius at one resolution."""
    return float(np.abs(np.linalg.eigvals(period_map(problem, base_nodes).matrix)).max())


@pytest.mark.parametrize("depth", PUBLISHED)
def test_textbook_values_to_a_millionth(depth: float) -> None:
    assert radius(textbook(depth), 8.0) == pytest.approx(PUBLISHED[depth], abs=5e-8)
    assert solve(textbook(depth)).spectral_radius == pytest.approx(PUBLISHED[depth], abs=1e-6)
    assert abs(leading_multiplier(textbook(depth), 6.0)) == pytest.approx(PUBLISHED[depth], abs=1e-6)


HARD = {
    "straight": {"exit": 1.5, "axes": 2}, "delay": {"exit": 1.5, "axes": 2, "shift": 0.3},
    "helix": {"exit": 1.5, "axes": 2, "lag": 800.0},
    "four teeth": {"exit": 2.8, "axes": 2, "teeth": 4, "lag": 100.0, "shift": -0.1},
}


@pytest.mark.parametrize("case", HARD)
def test_convergence_is_spectral(case: str) -> None:
    """Each four nodes more cut the error by ten or more until rounding; the first is already below 1e-4."""
    problem = textbook(0.4e-3, **HARD[case])  # type: ignore[arg-type]
    limit = radius(problem, 12.0)
    coarse, fine = (abs(radius(problem, b) - limit) for b in (0.0, 4.0))
    assert coarse < 1e-4
    assert fine < max(coarse / 10, 1e-7)


def check_against_reference(seed: int, steps: int) -> None:
    problem = random_problem(seed)
    for finer in (1, 3, 5, 8):
        reference, error = semidiscretization.extrapolated_radius(problem, finer * steps)
        if error < 3e-5:
            break
    assert error < 3e-5
    found = solve(problem)
    assert found.spectral_radius == pytest.approx(reference, abs=1e-4)
    assert abs(leading_multiplier(problem)) == pytest.approx(reference, abs=1e-4)
    assert found.error < 1e-4
    if abs(reference - 1) > 1e-3:
        assert (found.predicted_type is PredictedType.STABLE) == (reference < 1)


def steps_for(seed: int) -> int:
    problem = random_problem(seed)
    return max(semidiscretization.default_steps(problem, 60), 150)


SMALL = [seed for seed in range(150) if steps_for(seed) < 450][:25]


def test_the_seeds_cover_the_kinds() -> None:
    problems = [random_problem(seed) for seed in SMALL]
    assert len(problems) == 25
    assert {len(p.pitch) for p in problems} >= {1, 2, 3}
    assert {p.structure.size // 2 for p in problems} >= {1, 2, 5}
    for kind in (lambda p: p.helix_lag > 0, lambda p: p.uniform, lambda p: p.delay_variation > 0,
                 lambda p: p.delays[0] * p.tool_speed > 1.01 * p.pitch[0], lambda p: len(p.engagement.height) > 2):
        assert 0 < sum(map(kind, problems)) < 25


@pytest.mark.parametrize("seed", SMALL)
def test_random_problems_agree_with_the_reference(seed: int) -> None:
    check_against_reference(seed, steps_for(seed))


def affordable(seed: int) -> bool:
    """Whether the reference needs at most 6000 steps a period, counted for each delay."""
    problem = random_problem(seed)
    return steps_for(seed) * (1 if problem.uniform else len(problem.pitch)) <= 6000


@pytest.mark.slow
@pytest.mark.parametrize("number", range(500))
def test_many_random_problems_agree_with_the_reference(number: int, many: list[int]) -> None:
    check_against_reference(many[number], steps_for(many[number]))


@pytest.fixture(scope="module")
def many() -> list[int]:
    """The first 500 seeds from 1000 on for which the reference is affordable."""
    return list(itertools.islice(filter(affordable, itertools.count(1000)), 500))


@pytest.mark.parametrize("change", [
    {"process_damping": (2e4, 0.3)}, {"process_damping": (3e4, 0.5), "helix_lag": 300.0},
    {"rotating": True, "helix_lag": 400.0}, {"rotating": True, "process_damping": (2e4, 0.3), "helix_lag": 300.0},
], ids=["damping", "damping and helix", "rotating", "rotating and damping"])
@pytest.mark.parametrize("axes", [1, 2])
def test_process_damping_and_the_rotating_frame_agree_with_the_reference(change: dict[str, object], axes: int) -> None:
    problem = textbook(0.3e-3, axes=axes, exit=1.8, rpm=9000).at(**change)
    reference, error = semidiscretization.extrapolated_radius(problem, 250)
    assert error < 2e-4
    assert solve(problem).spectral_radius == pytest.approx(reference, abs=2e-5)
    assert abs(leading_multiplier(problem)) == pytest.approx(reference, abs=2e-5)


def test_process_damping_stabilises_and_vanishes() -> None:
    bare = solve(textbook(0.5e-3)).spectral_radius
    values = [solve(textbook(0.5e-3).at(process_damping=(c, 0.3))).spectral_radius for c in (1e4, 1e2, 1e0)]
    assert values[0] < values[1] < values[2] < bare
    assert values[2] == pytest.approx(bare, abs=1e-4)


@pytest.mark.parametrize("lag", [0.0, 400.0])
def test_a_symmetric_tool_is_the_same_in_both_frames(lag: float) -> None:
    """Damping fixed in the machine (K_crc present, erratum D7); the rotating frame's period is a revolution."""
    fixed = textbook(0.15e-3, axes=2, exit=1.8, rpm=9000, lag=lag)
    mode = Mode(922.0, 0.011, 0.03993, (1, 0, 0))
    structure = rotating_structure(mode, mode, fixed.tool_speed, "printed", "machine")
    rotating = fixed.at(structure=structure, rotating=True)
    in_fixed, in_rotating = (solve(p, 3.1e-6) for p in (fixed, rotating))
    assert in_rotating.spectral_radius == pytest.approx(in_fixed.spectral_radius**2, abs=1e-6)
    for seen, expected in zip(in_rotating.lines[:2], in_fixed.lines[:2], strict=True):  # both in the fixed frame
        assert seen.frequency == pytest.approx(expected.frequency, abs=0.01)
        assert seen.share == pytest.approx(expected.share, rel=0.01)


def test_tool_fixed_damping_is_another_system() -> None:
    mode = Mode(922.0, 0.05, 0.03993, (1, 0, 0))
    problem = textbook(0.15e-3, axes=2, exit=1.8, rpm=9000).at(rotating=True)
    speed = problem.tool_speed
    structures = [rotating_structure(mode, mode, speed, damping=d) for d in ("machine", "tool")]
    values = [solve(problem.at(structure=s)).spectral_radius for s in structures]
    assert abs(values[0] - values[1]) > 0.01


def test_unused_modes_and_states_change_nothing() -> None:
    """A mode along the tool axis alone moves nothing that changes the chip."""
    problem = textbook(0.5e-3, axes=2, exit=1.5)
    s = problem.structure
    spare = LinearStructure(
        np.block([[s.A, np.zeros((4, 2))], [np.zeros((2, 4)), np.array([[0.0, 1.0], [-4e6, -900.0]])]]),
        np.vstack([s.B, np.zeros((1, 3)), [[0, 0, 1.0]]]), np.hstack([s.C, [[0, 0], [0, 0], [1.0, 0]]]))
    with_spare = problem.at(structure=spare, coefficients=(600e6, 200e6, 90e6))
    assert solve(with_spare).spectral_radius == pytest.approx(solve(problem).spectral_radius, abs=1e-8)


@pytest.fixture(scope="module")
def case_1() -> Operation:
    """Thesis Table 4.9: helix, round bar, delayed rotation."""
    return read_operation(shipped_operations()["thesis_table_4_9"])


@pytest.mark.parametrize("name", ["thesis_table_4_9", "milling_benchmark_2dof"])
def test_a_series_of_depths_gives_what_each_depth_gives(name: str) -> None:
    op = read_operation(shipped_operations()[name])
    family = depth_family(op, op.conditions, 4e-3)
    depths = np.linspace(0.1e-3, 4e-3, 30)
    series = family.series(depths)
    found = np.abs(family.multipliers(series, 330.0))
    for depth, value in zip(depths[::3], found[::3], strict=True):
        exact = radius(family.problem(float(depth), 330.0), 8.0)
        assert value == pytest.approx(exact, abs=1e-4 * max(1.0, exact))


def test_a_straight_edge_needs_one_set_of_operators(case_1: Operation) -> None:
    assert not depth_family(case_1, case_1.conditions, 2e-3).series([1e-3, 2e-3]).proportional
    milling = read_operation(shipped_operations()["milling_benchmark_2dof"])
    series = depth_family(milling, milling.conditions, 2e-3).series([1e-3, 2e-3])
    assert series.proportional
    apart = dataclasses.replace(series, proportional=False)
    delays = series.problem.delays
    speed = series.problem.tool_speed
    np.testing.assert_allclose(*(np.abs(series_multipliers(s, speed, delays, np.zeros(2), None, 6.0))
                                 for s in (series, apart)), rtol=1e-6)


def test_the_error_estimate_is_not_too_low() -> None:
    for problem in (textbook(2e-3, exit=1.5, axes=2), textbook(1e-3, lag=900.0, teeth=3, axes=2)):
        found = solve(problem, 1e-3)
        assert abs(found.spectral_radius - radius(problem, 14.0)) <= 2 * found.error + 1e-9


def test_a_defective_structure_is_refused() -> None:
    A, B, C = np.array([[-100.0, 1.0], [0.0, -100.0]]), np.array([[0, 0, 0], [1.0, 0, 0]]), np.eye(3, 2)
    with pytest.raises(ValueError, match="defective"):
        modal_blocks(LinearStructure(A, B, C))


def test_nearly_singular_cases_do_not_crash() -> None:
    thin = textbook(1e-9, exit=1e-4, axes=2)
    assert solve(thin).predicted_type is PredictedType.STABLE
    weak = textbook(1e-3, axes=2).at(coefficients=(1e-3, 0.0, 0.0))
    assert solve(weak).predicted_type is PredictedType.STABLE
    twins = textbook(0.1e-3, axes=1)
    A = twins.structure.A
    B, C = np.vstack([twins.structure.B] * 2) / 2, np.hstack([twins.structure.C] * 2)
    double = LinearStructure(np.kron(np.eye(2), A), B, C)
    assert solve(twins.at(structure=double)).spectral_radius == pytest.approx(solve(twins).spectral_radius, abs=1e-6)


def low_immersion(helix: float, rpm: float) -> DepthFamily:
    """Table 4.10 at 5 % immersion, up-milling, engagement equal at all heights, to 20 mm."""
    op = read_operation(shipped_operations()["thesis_table_4_10"])
    immersion = 0.05 * op.tool.diameter
    cut = dataclasses.replace(
        op.conditions, cross_feed_span=(op.tool.radius - immersion, op.tool.radius), tool_speed=rpm * RPM)
    flat = dataclasses.replace(
        op, tool=dataclasses.replace(op.tool, helix_angle=np.radians(helix)), axial_feed=immersion,
        workpiece=dataclasses.replace(op.workpiece, diameter=20.0), conditions=cut)
    return depth_family(flat, cut, 20e-3)


def test_flip_lens_is_an_island() -> None:
    """With helix the cut is stable again above the lens."""
    intervals, types = stable_depths(low_immersion(25.0, 23294.0), scan=40)
    assert len(intervals) >= 2
    assert types[0, 1] == types[1, 0] == PredictedType.FLIP
    inside = 0.5 * (intervals[0, 1] + intervals[1, 0])
    verdict = solve(low_immersion(25.0, 23294.0).problem(inside))
    assert (verdict.predicted_type, verdict.flips) == (PredictedType.FLIP, 1)


def test_secondary_flip() -> None:
    """Two real multipliers below -1."""
    verdict = solve(low_immersion(0.0, 23250.0).problem(14.75e-3))
    assert (verdict.predicted_type, verdict.flips) == (PredictedType.FLIP, 2)
    assert np.all(verdict.multipliers[:2].real < -1)


def test_structures_are_compared_by_identity_and_reused() -> None:
    structure = textbook(1e-3).structure
    assert modal_blocks(structure) is modal_blocks(structure)
