"""The command plan: table, JSON, picture, the chosen cut as a file, and what it leaves when it ends early."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_ros.cli.app import run

RPM = math.pi / 30
SMALL = ["--tool-speeds", "1000rpm..12000rpm:16", "--depths", "0.5mm..10mm:12", "--samples", "3"]


def test_json_holds_the_choice_and_the_file_reads_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written, page = tmp_path / "best.yaml", tmp_path / "plan.html"
    assert run(["plan", "thesis_table_5_1", "--workpiece-speeds", "30rpm,60rpm", *SMALL, "--json",
                "--write", str(written), "--report", str(page)]) == 0
    found = json.loads(capsys.readouterr().out)
    first, second = found["regions"]
    assert first["tool_speed_min_rad_s"] == pytest.approx(5898.12 * RPM, rel=1e-5)
    assert first["best"]["binding"] == "tool spindle, peak torque"
    assert second["best"] is None
    assert "asks for a tool speed of at least 11796 rpm" in second["conflicts"][0]["text"]
    assert "at most 10345 rpm" in second["conflicts"][0]["text"]
    assert found["chosen"] == found["robust"]
    assert found["chosen"]["share_feasible"] >= 0.9
    assert all(m["margin"] >= 0 for m in found["chosen"]["limits"])
    op = read_operation(written)
    assert op.conditions.depth == pytest.approx(found["chosen"]["depth_m"])
    assert op.conditions.tool_speed == pytest.approx(found["chosen"]["tool_speed_rad_s"], rel=1e-8)
    assert op.name.endswith("(planned)")
    assert "Cut chosen by turnmill plan" in op.sources
    assert op.limits == read_operation(shipped_operations()["thesis_table_5_1"]).limits
    assert "What binds where" in page.read_text("utf-8")


def test_the_table_says_what_was_chosen_and_why_nothing_is_possible(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", "thesis_table_5_1", "--workpiece-speeds", "50rpm", *SMALL[:-1], "0"]) == 0
    shown = capsys.readouterr().out
    assert "9830-10345" in shown
    assert "Chosen cut" in shown
    assert run(["plan", "thesis_table_5_1", "--workpiece-speeds", "60rpm", *SMALL]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "no cut of Thesis Table 5.1" in told
    assert "at least 11796 rpm" in told


def test_the_schedule_of_the_old_cut_is_left_out(tmp_path: Path) -> None:
    written = tmp_path / "best.yaml"
    assert run(["plan", "demo_turn_milling", "--tool-speeds", "2000rpm..4000rpm:8", "--depths", "1mm..4mm:4",
                "--workpiece-speeds", "6rpm", "--samples", "0", "--write", str(written)]) == 0
    assert read_operation(written).schedule == ()


def test_an_interrupted_plan_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from turnmill_core.process import plan as core

    real, seen = core.region, []

    def interrupted(*arguments: object, **options: object) -> object:
        seen.append(1)
        if len(seen) == 2:
            raise KeyboardInterrupt
        return real(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(core, "region", interrupted)
    assert run(["plan", "thesis_table_5_1", "--workpiece-speeds", "10rpm,20rpm", *SMALL, "--write",
                str(tmp_path / "best.yaml"), "--report", str(tmp_path / "plan.html")]) == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("arguments", "words"), [
    (["--workpiece-speeds", "10:50:5"], "--workpiece-speeds"),
    (["--tool-speeds", "10rpm..50rpm"], "FROM..TO:COUNT"),
    (["--depths", "3mm..1mm:5"], "TO above FROM"),
    (["--share", "120%"], "--share"),
    (["--samples", "-1"], "--samples"),
    (["--feeds", "20mm/rev"], "axial feed"),
])
def test_bad_input_is_one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", "thesis_table_5_1", *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert "Traceback" not in told
