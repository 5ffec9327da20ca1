"""The commands vibration and surface: tables, JSON, files, and clear refusals."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from turnmill_core.process.surface_profile import circularity_error, static_cusp
from turnmill_ros.cli.app import run

OP = "turn_milling_axial_mode"
RPM = math.pi / 30
QUICK = ["--around", "2deg", "--rows", "40", "--columns", "30"]


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    """JSON of a command that must succeed."""
    assert run([*arguments, "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_steady_vibration(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    sheet, page = tmp_path / "v.csv", tmp_path / "v.html"
    found = told(capsys, "vibration", OP, "--csv", str(sheet), "--report", str(page))
    assert found["solution"] == "steady"
    assert found["spectral_radius"] < 1  # type: ignore[operator]
    samples = np.genfromtxt(sheet, delimiter=",", names=True)
    for axis, value in zip("xyz", found["tool_displacement_peak_to_peak_m"], strict=True):  # type: ignore[call-overload]
        assert np.ptp(samples[f"tool_{axis}_m"]) == pytest.approx(value, rel=1e-6)
    assert samples["time_s"][1] == pytest.approx(samples["tool_angle_rad"][1] / (4000 * RPM))
    assert "Displacement of the tool" in page.read_text(encoding="utf-8")


def test_machine_frame_turns_the_vectors(capsys: pytest.CaptureFixture[str]) -> None:
    """z_T = x_M in turn-milling."""
    tool, machine = (told(capsys, "vibration", OP, "--frame", frame) for frame in ("tool", "machine"))
    assert machine["force_mean_n"][0] == pytest.approx(tool["force_mean_n"][2])  # type: ignore[index]
    assert machine["force_mean_n"][1] == pytest.approx(-tool["force_mean_n"][0])  # type: ignore[index]


def test_solutions_agree_and_tables_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    steady = told(capsys, "vibration", OP)
    linear = told(capsys, "vibration", OP, "--solution", "linear", "--turns", "30")
    assert linear["force_rms_n"] == pytest.approx(steady["force_rms_n"], rel=1e-3)
    assert run(["vibration", OP, "--solution", "nonlinear", "--turns", "3"]) == 0
    assert "tool torque, N m" in capsys.readouterr().out


def test_chatter_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["vibration", "milling_benchmark_1dof", "--depth", "1mm"]) == 0
    assert "this cut chatters" in capsys.readouterr().out


def test_surface_figures(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    sheet, mesh, page, image = (tmp_path / f"s.{end}" for end in ("csv", "ply", "html", "png"))
    found = told(capsys, "surface", OP, *QUICK, "--csv", str(sheet), "--ply", str(mesh), "--report", str(page),
                 "--png", str(image))
    assert found["warnings"] == []
    assert image.read_bytes().startswith(b"\x89PNG")
    assert found["circularity_m"] == pytest.approx(circularity_error(22.2e-3, 6 * RPM, 4000 * RPM, 2), rel=1e-9)
    assert found["cusp_m"] == pytest.approx(static_cusp(found["feed_per_tooth_m"], math.radians(2.73)), rel=1e-9)  # type: ignore[arg-type]
    assert found["overcut_m"] > found["undercut_m"] >= 0  # type: ignore[operator]
    heights = np.genfromtxt(sheet, delimiter=",", skip_header=1)[:, 1:]
    assert heights.shape == (40, 30)
    assert heights.max() == pytest.approx(found["map"]["undercut_m"], rel=1e-4)  # type: ignore[index]
    header, _, data = mesh.read_bytes().partition(b"end_header\n")
    assert b"element vertex 1200\n" in header
    vertices = np.frombuffer(data[: 1200 * 16], dtype="<f4").reshape(-1, 4)
    np.testing.assert_allclose(np.hypot(vertices[:, 0], vertices[:, 1]) - 22.2e-3, vertices[:, 3], atol=1e-8)
    faces = np.frombuffer(data[1200 * 16 :], dtype=[("n", "u1"), ("corners", "<i4", 4)])
    assert len(faces) == 39 * 29
    assert faces["corners"].max() == 1199
    assert "Finished surface" in page.read_text(encoding="utf-8")


def test_study_of_speeds_and_depths(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    page = tmp_path / "s.html"
    assert run(["surface", OP, *QUICK, "--study", "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert all(f"Figure 5.{k}" in text for k in (6, 7, 8))
    assert "form error (Eq. 5.6)" in capsys.readouterr().out


@pytest.mark.parametrize(("arguments", "said"), [
    (["surface", "milling_benchmark_1dof"], "process is"),
    (["surface", OP, "--around", "400deg"], "angle around"),
    (["surface", OP, "--study"], "--report"),
    (["vibration", OP, "--turns", "0"], "--turns"),
    (["vibration", OP, "--tool-speed", "0rpm"], "tool speed"),
    (["vibration", OP, "--csv", "/nowhere/v.csv"], "folder"),
])
def test_refusals(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
