"""Kinematics of the machine: closed form, round trips on both branches, the singular axis, the Jacobian."""

from __future__ import annotations

import math

import numpy as np
import pytest

from turnmill_core.machine import denavit_hartenberg as dh
from turnmill_core.machine import screw
from turnmill_core.machine.inverse_kinematics import (
    drive_velocities,
    inverse,
    inverse_path,
    is_singular,
    rotary_angles,
    slides,
)
from turnmill_core.machine.kinematics import (
    NT3150,
    MachineKinematics,
    RotaryAxis,
    forward,
    jacobian,
    slides_at,
    tip_in_machine,
    with_tool_length,
)

OFFSET = MachineKinematics(
    "offset axes", RotaryAxis((0.0, 2.0, 0.0), (0.11, -0.03, 0.4)), RotaryAxis((0.0, 0.0, 1.0), (-0.02, 0.01, 0.3)),
    tool_tip=(0.12, -0.01, 0.15), workpiece_datum=(0.2, -0.1, 0.05))
SKEW = MachineKinematics(
    "skew axes", RotaryAxis((0.1, 0.9, 0.2), (0.1, 0.2, 0.3)), RotaryAxis((0.05, -0.1, 1.0), (0.0, 0.03, 0.0)),
    tool_axis=(0.1, 0.05, 1.0), tool_tip=(0.0, 0.1, -0.2), workpiece_datum=(0.3, 0.0, 0.1))
NUTATING = MachineKinematics("45 deg head", RotaryAxis((0.0, 1.0, 1.0)), tool_tip=(0.0, 0.0, -0.2))
MACHINES = (NT3150, with_tool_length(NT3150, 0.25), OFFSET, SKEW, NUTATING)
RNG = np.random.default_rng(316)


@pytest.fixture(autouse=True)
def _seed() -> None:
    """The same random numbers for a test, whichever tests run before it."""
    RNG.bit_generator.state = np.random.default_rng(316).bit_generator.state


def random_drives(n: int, rng: np.random.Generator = RNG) -> np.ndarray:
    return np.concatenate([rng.uniform(-0.5, 0.5, (n, 3)), rng.uniform(-math.pi, math.pi, (n, 2))], 1)


def away_from_singularity(machine: MachineKinematics, drives: np.ndarray) -> np.ndarray:
    """Drives with the tool at least 0.05 from the C axis and the two branches at least 0.05 apart."""
    both = rotary_angles(machine, forward(machine, drives)[1])
    apart = np.abs(np.remainder(both[:, 0] - both[:, 1] + math.pi, 2 * math.pi) - math.pi).max(-1)
    return drives[~is_singular(machine, forward(machine, drives)[1], 0.05) & (apart > 0.05)]


def round_trip(machine: MachineKinematics, drives: np.ndarray) -> tuple[float, float]:
    """Largest pose error of both branches, and of the drives on the branch they came from [m and rad]."""
    tip, axis = forward(machine, drives)
    both = inverse(machine, tip, axis)
    back_tip, back_axis = forward(machine, both)
    pose = max(np.abs(back_tip - tip[:, None]).max(), np.abs(back_axis - axis[:, None]).max())
    off = both - drives[:, None]
    off[..., 3:] = np.remainder(off[..., 3:] + math.pi, 2 * math.pi) - math.pi
    return float(pose), float(np.abs(off).max(-1).min(-1).max())


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_random_poses_return_on_both_branches(machine: MachineKinematics) -> None:
    pose, drives = round_trip(machine, away_from_singularity(machine, random_drives(500)))
    assert pose < 1e-12
    assert drives < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_ten_thousand_poses_return_on_both_branches(machine: MachineKinematics) -> None:
    drives = away_from_singularity(machine, random_drives(30_000, np.random.default_rng(10_000)))[:10_000]
    assert len(drives) == 10_000
    assert max(round_trip(machine, drives)) < 1e-12


def test_forward_in_closed_form() -> None:
    """O = Rz(-c) Ry(b) e3 (erratum K5), P = Rz(-c) (x, y, z) with the tip on the B axis."""
    x, y, z, b, c = 0.1, -0.02, 0.3, 0.7, 2.1
    tip, axis = forward(NT3150, [x, y, z, b, c])
    assert axis == pytest.approx([math.sin(b) * math.cos(c), -math.sin(b) * math.sin(c), math.cos(b)], abs=1e-15)
    assert tip == pytest.approx(
        [x * math.cos(c) + y * math.sin(c), y * math.cos(c) - x * math.sin(c), z], abs=1e-15)


def test_orthogonal_turn_milling_points_the_tool_along_x() -> None:
    """b = 90 deg: z_T = +x_M, the tip lies towards -x of the B axis by the tool's length (docs/frames.md)."""
    long = with_tool_length(NT3150, 0.2)
    assert forward(long, [0.5, 0.0, 0.0, math.pi / 2, 0.0])[1] == pytest.approx([1, 0, 0], abs=1e-15)
    assert tip_in_machine(long, [0.5, 0.0, 0.0, math.pi / 2, 0.0]) == pytest.approx([0.3, 0, 0], abs=1e-15)
    assert slides_at(long, [0.3, 0.0, 0.0], math.pi / 2) == pytest.approx([0.5, 0, 0], abs=1e-15)


def test_rotary_angles_of_the_default_machine_in_closed_form() -> None:
    axis = screw.unit(RNG.normal(size=(200, 3)))
    found = rotary_angles(NT3150, axis)
    b = np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2])
    assert found[:, 0, 0] == pytest.approx(b, abs=1e-15)
    assert found[:, 1, 0] == pytest.approx(-b, abs=1e-15)
    assert found[:, 0, 1] == pytest.approx(np.arctan2(-axis[:, 1], axis[:, 0]), abs=1e-15)
    assert found[:, 1, 1] == pytest.approx(np.arctan2(axis[:, 1], -axis[:, 0]), abs=1e-15)


def test_printed_sign_of_equation_3_16_misses_the_tool_tip() -> None:
    """Erratum K3: exp(-xi_c c) in place of exp(+xi_c c) is off by centimetres."""
    drives = away_from_singularity(OFFSET, random_drives(200))
    tip, _ = forward(OFFSET, drives)
    right, printed = (slides(OFFSET, tip, drives[:, 3], sign * drives[:, 4]) for sign in (1, -1))
    assert right == pytest.approx(drives[:, :3], abs=1e-14)
    assert np.median(np.linalg.norm(printed - drives[:, :3], axis=1)) > 0.05


def test_a_path_through_the_singular_axis_stays_continuous() -> None:
    """The tool tilts in one plane through the C axis: c holds, b changes its sign."""
    tilt = np.linspace(-0.5, 0.5, 1001)
    for c in (0.0, 1.0, 2.5):
        axis = np.stack([np.sin(tilt) * math.cos(c), -np.sin(tilt) * math.sin(c), np.cos(tilt)], -1)
        tip = np.stack([0.05 + 0.01 * tilt, 0 * tilt, 0.02 * tilt], -1)
        assert is_singular(NT3150, axis).sum() == 1
        drives = inverse_path(NT3150, tip, axis, start=(-0.5, c))
        assert np.abs(np.diff(drives, axis=0)).max() < 1.1e-3
        assert drives[:, 3:] == pytest.approx(np.stack([tilt, np.full_like(tilt, c)], -1), abs=1e-12)
        back_tip, back_axis = forward(NT3150, drives)
        assert back_tip == pytest.approx(tip, abs=1e-12)
        assert back_axis == pytest.approx(axis, abs=1e-12)


def test_a_path_that_rests_on_the_singular_axis_holds_c() -> None:
    axis = np.concatenate([np.tile([[math.sin(0.2), 0.0, math.cos(0.2)]], (3, 1)), np.tile([[0.0, 0.0, 1.0]], (5, 1))])
    drives = inverse_path(NT3150, np.zeros((8, 3)), axis, start=(0.2, 4 * math.pi))
    assert drives[:, 4] == pytest.approx(np.full(8, 4 * math.pi))
    noisy = axis + 3e-7 * RNG.normal(size=axis.shape)
    drives = inverse_path(NT3150, np.zeros((8, 3)), noisy, start=(0.2, 0.0), tolerance=2e-6)
    assert np.abs(drives[3:, 4] - drives[2, 4]).max() == 0


def test_c_runs_on_beyond_a_revolution() -> None:
    c = np.linspace(0, 6 * math.pi, 200)
    axis = np.stack([math.sin(0.8) * np.cos(c), -math.sin(0.8) * np.sin(c), np.full_like(c, math.cos(0.8))], -1)
    drives = inverse_path(NT3150, np.zeros((200, 3)), axis, start=(0.8, 0.0))
    assert drives[:, 4] == pytest.approx(c, abs=1e-12)
    assert drives[:, 3] == pytest.approx(np.full(200, 0.8), abs=1e-12)


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_jacobian_equals_finite_differences(machine: MachineKinematics) -> None:
    h = 1e-5
    for q in random_drives(20):
        numeric = np.stack([(np.concatenate(forward(machine, q + h * e)) - np.concatenate(forward(machine, q - h * e)))
                            / (2 * h) for e in np.eye(5)], -1)
        assert jacobian(machine, q) == pytest.approx(numeric, abs=1e-9)


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_drive_velocities_return_the_motion_of_the_pose(machine: MachineKinematics) -> None:
    for q in away_from_singularity(machine, random_drives(20)):
        speeds = RNG.normal(size=5)
        motion = jacobian(machine, q) @ speeds
        assert drive_velocities(machine, q, motion[:3], motion[3:]) == pytest.approx(speeds, abs=1e-10)


def test_at_the_singular_axis_only_b_can_tilt_the_tool() -> None:
    q = [0.1, 0.0, 0.2, 0.0, 0.0]
    assert jacobian(NT3150, q)[3:, 4] == pytest.approx(np.zeros(3), abs=1e-15)
    assert drive_velocities(NT3150, q, [0, 0, 0], [0.3, 0, 0])[3:] == pytest.approx([0.3, 0], abs=1e-12)
    with pytest.raises(ValueError, match=r"axis rate.*singular axis"):
        drive_velocities(NT3150, q, [0, 0, 0], [0.0, 0.3, 0])


def test_denavit_hartenberg_links_give_the_same_machine() -> None:
    drives = random_drives(300)
    for found, expected in zip(dh.forward(drives), forward(NT3150, drives), strict=True):
        assert found == pytest.approx(expected, abs=1e-15)


def test_denavit_hartenberg_angles_agree_only_for_a_tool_in_the_xz_plane_above_the_horizon() -> None:
    """Erratum K5, both sides of the limit."""
    tilt = np.linspace(-1.5, 1.5, 301)
    axis = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], -1)
    screw_b = inverse_path(NT3150, 0 * axis, axis, start=(-1.5, 0.0))[:, 3:]
    assert dh.agrees_with_machine(axis).all()
    assert dh.rotary_angles(axis) == pytest.approx(screw_b, abs=5e-16)
    outside = screw.unit(RNG.normal(size=(300, 3)))
    outside = outside[(np.abs(outside[:, 1]) > 0.1) & (np.abs(outside[:, 0]) > 0.1)]
    below = np.stack([np.sin(tilt), 0 * tilt, -np.cos(tilt)], -1)
    for wrong in (outside, below):
        assert not dh.agrees_with_machine(wrong).any()
        angles = dh.rotary_angles(wrong)
        pose = forward(NT3150, np.concatenate([0 * wrong, angles], -1))[1]
        assert np.linalg.norm(pose - wrong, axis=-1).min() > 1e-3


def test_denavit_hartenberg_angles_solve_the_chain_with_c_about_x() -> None:
    """O = T_C T_B e3; Eq. 3.20 as printed, T_B T_C O = e3, holds for the opposite angles."""
    for axis in screw.unit(RNG.normal(size=(50, 3))):
        b, c = dh.rotary_angles(axis)
        assert dh.c_matrix(c) @ dh.b_matrix(b) @ [0, 0, 1] == pytest.approx(axis, abs=1e-15)
        assert dh.b_matrix(-b) @ dh.c_matrix(-c) @ axis == pytest.approx([0, 0, 1], abs=1e-15)


def test_a_45_degree_head_reaches_the_upper_half_only() -> None:
    assert rotary_angles(NUTATING, [1.0, 0.0, 0.0]).shape == (2, 2)
    with pytest.raises(ValueError, match="cannot be reached"):
        inverse_path(NUTATING, np.zeros((2, 3)), [[0.0, 0.0, 1.0], [0.6, 0.0, -0.8]])


@pytest.mark.parametrize(("values", "words"), [
    ({"b": RotaryAxis((0.0, 0.0, 2.0))}, "direction of the b axis"),
    ({"tool_axis": (0.0, 1.0, 0.0)}, "tool axis"),
    ({"tool_axis": (0.0, 0.0, 0.0)}, "tool axis"),
    ({"tool_tip": (math.nan, 0.0, 0.0)}, "tool tip"),
    ({"workpiece_datum": (0.0, math.inf, 0.0)}, "workpiece datum"),
])
def test_machines_that_cannot_exist(values: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        MachineKinematics(**values)  # type: ignore[arg-type]


def test_axes_without_direction_and_tools_without_length() -> None:
    with pytest.raises(ValueError, match="rotary axis direction"):
        RotaryAxis((0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="tool length"):
        with_tool_length(NT3150, -0.1)
