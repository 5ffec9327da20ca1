"""Modes and limits over machine positions and along a bar, and a chuck from a dummy, from the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from turnmill_core.machine.conditions import machine_from_tool, nominal_axes
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.structure.at import plain_structures
from turnmill_core.structure.beam import free_bar, on_chuck, receptances
from turnmill_core.structure.profile import stock_profile
from turnmill_ros.along import along_axis, along_bar, nominal_index, stations, with_nominal
from turnmill_ros.bar_receptance import before_and_after
from turnmill_ros.cli.app import run


def test_limits_over_the_rams_stroke(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The longer the ram, the lower the limit; frequency and mass between the ends are linear."""
    page = tmp_path / "ram.html"
    assert run(["positions", "thesis_table_4_5", "--count", "3", "--points", "12", "--tool-speeds",
                "4000rpm..5000rpm", "--deepest", "8mm", "--report", str(page), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["axis"] == "y"
    limits = [s["lowest_limit_m"] for s in found["stations"]]
    assert limits == sorted(limits, reverse=True)
    middle = found["stations"][1]["tool_modes"][1]
    assert (middle["frequency_hz"], middle["mass_kg"]) == pytest.approx((742.5, 0.975))
    assert "Depth limit" in page.read_text(encoding="utf-8")


def test_a_limit_of_a_station_is_that_of_its_modes() -> None:
    """The same modes given as a plain structure have the same limit."""
    import dataclasses

    op = read_operation(shipped_operations()["thesis_table_4_5"])
    cut, speeds = op.conditions, with_nominal(np.array([450.0]), op.conditions)
    place = along_axis(op, cut, "y", np.array([0.125]))
    station, = stations(op, cut, place, speeds, 6e-3)
    assert nominal_index(speeds, cut) == 1
    plain = dataclasses.replace(op, tool=dataclasses.replace(op.tool, structure=station.tool))
    again, = stations(plain, cut, place, speeds, 6e-3)
    np.testing.assert_allclose(station.limit, again.limit, rtol=1e-12)


def test_receptance_before_and_after_and_limits_along_the_pass(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    page = tmp_path / "bar.html"
    assert run(["workpiece", "thesis_table_4_7", "--depth", "10mm", "--count", "3", "--points", "6", "--deepest",
                "20mm", "--report", str(page), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["mass_before_kg"] == pytest.approx(2700 * math.pi * 0.05**2 * 0.12)
    assert found["mass_after_kg"] == pytest.approx(2700 * math.pi * 0.04**2 * 0.12)
    assert {(r["plane"], r["state"]) for r in found["receptances"]} == {
        (p, s) for p in "xy" for s in ("before", "after")}
    first = [s["workpiece_modes"][0]["frequency_hz"] for s in found["stations"]]
    assert first == sorted(first)
    assert "before" in page.read_text(encoding="utf-8")


def test_after_the_pass_the_bar_is_a_thinner_one() -> None:
    """The receptance after the pass is that of a bar of the finished diameter."""
    op = read_operation(shipped_operations()["thesis_table_4_7"])
    import dataclasses

    f = np.linspace(50.0, 1500.0, 40)
    cut = dataclasses.replace(op.conditions, depth=0.01)
    after = before_and_after(op, cut, 0.02, f)
    thin = dataclasses.replace(op, workpiece=dataclasses.replace(op.workpiece, diameter=0.08))
    before = before_and_after(thin, cut, 0.02, f)
    np.testing.assert_allclose(after.receptance[1], before.receptance[0], rtol=1e-9)


def test_the_pass_runs_over_the_bar() -> None:
    op = read_operation(shipped_operations()["thesis_table_4_7"])
    places = along_bar(op, op.conditions, 5)
    start = nominal_axes(op).position
    assert places[0][1] == start
    assert places[-1][0] == pytest.approx(op.workpiece.length - op.axial_feed)
    rotation = machine_from_tool(op, op.conditions)
    begun, ended = (plain_structures(op, rotation, op.conditions, places[k][1])[1] for k in (0, -1))
    assert abs(begun.modes[0].shape[0]) > abs(ended.modes[0].shape[0])


@pytest.mark.parametrize(("arguments", "words"), [
    (["workpiece", "thesis_table_4_9"], "beam is missing"), (["positions", "thesis_table_4_9"], "--axis"),
    (["positions", "thesis_table_4_9", "--axis", "x"], "--over"),
    (["positions", "thesis_table_4_5", "--over", "5mm"], "FROM..TO"),
    (["workpiece", "thesis_table_4_7", "--band", "100Hz..50Hz"], "ascending"),
    (["workpiece", "thesis_table_4_7", "--at", "500mm"], "place on the bar"),
    (["positions", "thesis_table_4_5", "--count", "1"], "--count"),
])
def test_bad_requests_are_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert words in " ".join(error.split())
    assert len(error.strip().splitlines()) == 1


def dummy_table(path: Path, noise: float = 0.0) -> Path:
    """H11, H12, H22 of the aluminium bar on its fitted chuck, at 0 and 60 mm, with noise relative to the largest."""
    op = read_operation(shipped_operations()["thesis_table_4_7"])
    beam = op.workpiece.beam
    assert beam is not None
    f = np.arange(100.0, 1600.0, 5.0)
    held = on_chuck(free_bar(stock_profile(op.workpiece), beam.material), beam.chuck_x)
    H = receptances(held, np.vstack([held.row(0.0), held.row(0.06)]), f)
    rng = np.random.default_rng(5)
    columns, names = [f], ["frequency [Hz]"]
    for i, j in ((0, 0), (0, 1), (1, 1)):
        measured = H[:, i, j] + noise * np.abs(H).max() * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        columns += [measured.real, measured.imag]
        names += [f"{i + 1}{j + 1} real [m/N]", f"{i + 1}{j + 1} imag [m/N]"]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.12e")
    return path


def test_a_chuck_from_a_dummy_becomes_an_operation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The printed chuck's file becomes the fitted one's."""
    out, page = tmp_path / "mine.yaml", tmp_path / "chuck.html"
    assert run(["chuck", str(dummy_table(tmp_path / "dummy.csv")), "thesis_table_4_6", "--points", "0mm,60mm",
                "--write", str(out), "--report", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["deviation"] < 1e-3
    found, wanted = (read_operation(p).workpiece.beam for p in (out, shipped_operations()["thesis_table_4_7"]))
    assert found is not None
    assert wanted is not None
    mode, true = found.chuck_x.modes[0], wanted.chuck_x.modes[0]
    for name in ("frequency", "damping", "mass", "pivot"):
        assert getattr(mode, name) == pytest.approx(getattr(true, name), rel=1e-3), name
    assert found.chuck_x.rotational_stiffness == pytest.approx(6.5e5, rel=1e-3)
    assert found.chuck_y != wanted.chuck_y
    assert "Receptance of the chuck" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(("arguments", "words"), [
    (["thesis_table_4_9"], "beam is missing"), (["thesis_table_4_7", "--points", "0mm"], "--points"),
    (["thesis_table_4_7", "--points", "0mm,0mm"], "different places"),
    (["thesis_table_4_7", "--band", "1Hz..2Hz"], "16 frequencies"),
])
def test_bad_dummies_are_one_line(
    tmp_path: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["chuck", str(dummy_table(tmp_path / "dummy.csv")), *arguments]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
