"""The command identify: tables of average forces, coefficients, the operation and the page it writes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.cutting.cases import AL6061
from tests.test_cli import ask
from turnmill_core.cutting.identification import AverageForces, identify
from turnmill_core.operation import Tool
from turnmill_core.operation_file import read_operation
from turnmill_ros.errors import InputError
from turnmill_ros.force_table import read_force_table

TRUTH = (930.0, 290.0, 242.0, 21.0, 25.0, 8.0)
TOOL = Tool("t", 0.016, 2, math.radians(25))
FEEDS = (0.05, 0.1, 0.15, 0.2)


def mean_force(feed: float, depth: float, start: float, stop: float) -> np.ndarray:
    """Average force [N] of TOOL with AL6061 by quadrature of the elementary forces; lengths in mm."""
    phi = np.linspace(start, stop, 20001)
    tangential = TRUTH[0] * feed * np.sin(phi) + TRUTH[3] / math.cos(TOOL.helix_angle)
    radial = TRUTH[1] * feed * np.sin(phi) + TRUTH[4] / math.cos(TOOL.helix_angle)
    axial = TRUTH[2] * feed * np.sin(phi) + TRUTH[5] / math.cos(TOOL.helix_angle)
    parts = (-radial * np.sin(phi) - tangential * np.cos(phi), -radial * np.cos(phi) + tangential * np.sin(phi), -axial)
    return np.array([np.trapezoid(p, phi) for p in parts]) * TOOL.teeth * depth / (2 * math.pi)


def slots(path: Path, noise: float = 0.0, sign: float = 1.0) -> Path:
    rng = np.random.default_rng(1)
    lines = ["feed per tooth [mm],Fx [N],Fy [N],Fz [N]"]
    for feed in FEEDS * 2:
        force = sign * mean_force(feed, 1.0, 0.0, math.pi) + rng.normal(0, noise, 3)
        lines.append(",".join(f"{x:.9g}" for x in (feed, *force)))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_identifies_writes_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = slots(tmp_path / "slots.csv", 0.5, sign=-1.0)
    new, html = tmp_path / "new.yaml", tmp_path / "fit.html"
    code, out, err = ask(
        capsys, "identify", str(file), "thesis_table_3_1", "--sense", "slot", "--depth", "1mm", "--measured-on",
        "workpiece", "--json", "--write", str(new), "--report", str(html))
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["tests"] == 8
    for name, truth in zip(("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae"), TRUTH, strict=True):
        key, scale = (f"{name}_pa", 1e6) if name[-1] == "c" else (f"{name}_n_m", 1e3)
        row = found["coefficients"][key]
        assert row["lower"] < row["value"] < row["upper"]
        assert row["value"] == pytest.approx(truth * scale, rel=0.15)
        assert getattr(read_operation(new).material, name) == pytest.approx(row["value"], rel=1e-7)
    written = read_operation(new)
    assert written.material.name == "identified"
    assert written.tool.diameter == 0.016
    assert "8 tests of average forces in slots.csv" in written.sources
    page = html.read_text()
    assert all(words in page for words in ("Measured minus fitted", "95 % interval", "Ktc"))
    code, out, _ = ask(capsys, "identify", str(file), "thesis_table_3_1", "--sense", "slot", "--depth", "1mm",
                       "--measured-on", "workpiece")
    assert code == 0
    assert "MPa" in out
    assert "95 % interval" in out


@pytest.mark.parametrize(("sense", "width", "arc"), [
    ("up", 4.0, (0.0, math.pi / 3)), ("down", 4.0, (2 * math.pi / 3, math.pi)), ("slot", 16.0, (0.0, math.pi)),
    ("centred", 8.0, (math.pi / 3, 2 * math.pi / 3))])
def test_engagement_from_the_radial_immersion(
    sense: str, width: float, arc: tuple[float, float], tmp_path: Path
) -> None:
    file = tmp_path / "t.csv"
    file.write_text("\n".join(["fz [um];ae [mm];ap [mm];Fx (N);Fy (N);fz (N)"] + [
        f"{f * 1e3};{width};1,5;" + ";".join(map(str, mean_force(f, 1.5, *arc))) for f in FEEDS]))
    tests = read_force_table(file, TOOL, sense, None, None)  # type: ignore[arg-type]
    assert tests.start == pytest.approx(np.full(4, arc[0]))
    assert tests.exit == pytest.approx(np.full(4, arc[1]))
    assert identify(TOOL, tests).value == pytest.approx([
        AL6061.Ktc, AL6061.Krc, AL6061.Kac, AL6061.Kte, AL6061.Kre, AL6061.Kae], rel=1e-5)


def test_feeds_per_revolution_and_per_minute(tmp_path: Path) -> None:
    found: list[AverageForces] = []
    for text in ("feed [mm/tooth],1", "feed [mm/rev],2", "feed [mm/min],2000"):
        header, factor = text.split(",")
        rows = [f"{f * float(factor)},1000,1,0,180,1,2,3" for f in FEEDS]
        file = tmp_path / "t.csv"
        header += ",speed [rpm],depth [mm],start [deg],exit [deg],Fx [N],Fy [kN],Fz [N]"
        file.write_text("\n".join([header, *rows]))
        found.append(read_force_table(file, TOOL, "up", None, None))
    for tests in found:
        assert tests.feed_per_tooth == pytest.approx(np.array(FEEDS) * 1e-3)
        assert tests.exit == pytest.approx(np.full(4, math.pi))
        assert tests.force[0] == pytest.approx([1, 2000, 3])


@pytest.mark.parametrize(("header", "row", "words"), [
    ("feed [mm],Fx [N],Fy [N]", "0.1,1,2", "Fz"),
    ("feed [mm],Fx,Fy [N],Fz [N]", "0.1,1,2,3", "Fx: a column has no unit"),
    ("feed [mm],Fx [mm],Fy [N],Fz [N]", "0.1,1,2,3", "unit of column Fx"),
    ("feed [mm/min],Fx [N],Fy [N],Fz [N]", "0.1,1,2,3", "spindle speed"),
    ("feed [kg],Fx [N],Fy [N],Fz [N]", "0.1,1,2,3", "unknown unit of the feed"),
    ("feed [mm],Fx [N],Fy [N],Fz [N]", "0.1,1,,3", "row 2, column Fy"),
    ("feed [mm],Fx [N],Fy [N],Fz [N]", "0.1,one,2,3", "not a number"),
    ("feed [mm],fx [N],Fx [N],Fy [N],Fz [N]", "0.1,1,1,2,3", "two columns"),
    ("feed [mm],Fx [N],Fy [N],Fz [N]", "0.1,1,2,3", "no engagement"),
    ("feed [mm],ae [mm],Fx [N],Fy [N],Fz [N]", "0.1,4,1,2,3", "no depth of cut"),
    ("feed [mm],ae [mm],Fx [N],Fy [N],Fz [N]", "0.1,40,1,2,3", "radial immersion out of bounds"),
    ("feed [mm],ae [mm],ap [mm],Fx [N],Fy [N],Fz [N]", "-0.1,4,1,1,2,3", "feed_per_tooth is"),
])
def test_bad_tables_name_the_place(header: str, row: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "t.csv"
    file.write_text("\n".join([header, row, row]))
    with pytest.raises((InputError, ValueError), match=words):
        read_force_table(file, TOOL, "up", None, None)


def test_one_feed_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "t.csv"
    file.write_text("feed [mm],Fx [N],Fy [N],Fz [N]\n" + "0.1,1,2,3\n" * 4)
    code, out, err = ask(capsys, "identify", str(file), "thesis_table_3_1", "--sense", "slot", "--depth", "1mm",
                         "--write", str(tmp_path / "new.yaml"))
    assert (code, out) == (2, "")
    assert "different feeds" in err
    assert not (tmp_path / "new.yaml").exists()


def test_the_alloys_are_listed_with_their_sources(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, "operation", "--alloys")
    assert code == 0
    assert "Budak" in out
    assert "0.005 to 0.2" in out
    found = json.loads(ask(capsys, "operation", "--alloys", "--json")[1])
    assert [alloy["name"] for alloy in found] == ["Ti6Al4V", "Al7050-T7451"]
    assert found[0]["Kte_n_m"] == 24e3
