"""The command line: what it prints, and what it says of bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from turnmill_ros.cli.app import PANELS, run

COMMANDS = [name for commands in PANELS.values() for name in commands]


def ask(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(list(arguments))
    text = capsys.readouterr()
    return code, text.out, text.err


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, command, "--help")
    assert code == 0
    assert f"Example: turnmill {command}" in " ".join(out.split())


def test_stability_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, "stability", "thesis_table_4_9", "--tool-speed", "3350rpm", "--workpiece-speed", "6rpm",
                       "--depth", "1.2mm", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["tool_speed_rad_s"] == pytest.approx(350.811, abs=1e-3)
    assert found["depth_m"] == pytest.approx(1.2e-3)
    assert found["predicted_type"] == "STABLE"
    assert found["depth_limit_m"] > 1.2e-3
    assert found["delay_s"] == pytest.approx(60 / 3350 / 2 * (1 + 6 / 3350))


def test_forces_scale_with_depth_and_vanish_in_air(capsys: pytest.CaptureFixture[str]) -> None:
    air = json.loads(ask(capsys, "forces", "thesis_table_3_1", "--depth", "-1mm", "--json")[1])
    cut = json.loads(ask(capsys, "forces", "thesis_table_3_1", "--json")[1])
    assert not air["in_cut"]
    assert air["tool_torque_peak_n_m"] == 0
    assert cut["in_cut"]
    assert cut["tool_torque_peak_n_m"] > 1


def test_operation_prints_back_with_units(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, "operation", "thesis_table_4_9")
    assert code == 0
    assert "3350 rpm" in out
    assert "sha256" in out


def test_set_changes_the_operation_and_its_hash(capsys: pytest.CaptureFixture[str]) -> None:
    plain = json.loads(ask(capsys, "operation", "face_mill_6_teeth", "--json")[1])
    changed = json.loads(ask(capsys, "operation", "face_mill_6_teeth", "--set", "tool.teeth=4", "--json")[1])
    assert plain["sha256"] != changed["sha256"]
    assert changed["sections"]["tool"]["teeth"] == "4"


@pytest.mark.parametrize(("arguments", "words"), [
    (("stability", "nowhere.yaml"), ("nowhere.yaml", "no such operation")),
    (("stability", "thesis_table_4_9", "--depth", "1.2"), ("--depth", "1.2", "mm")),
    (("stability", "thesis_table_4_9", "--tool-speed", "3350 kg"), ("--tool-speed", "3350 kg", "rpm")),
    (("operation", "face_mill_6_teeth", "--set", "tool.teeth"), ("tool.teeth", "KEY.PATH=VALUE")),
    (("operation", "face_mill_6_teeth", "--set", "tool.teeth=none"), ("tool.teeth", "none")),
    (("operation", "face_mill_6_teeth", "--set", "nothing.there=1"), ("nothing",)),
    (("analyze", "nowhere.mcap"), ("nowhere.mcap",)),
    (("recover", "nowhere.mcap"), ("nowhere.mcap",)),
    (("replay", "nowhere.mcap"), ("nowhere.mcap",)),
    (("replay", "nowhere.mcap", "--rate", "0"), ("--rate", "0", "max")),
    (("import", "nowhere.wav", "--operation", "face_mill_6_teeth", "-o", "new.mcap"), ("nowhere.wav",)),
    (("simulate", "demo_turn_milling", "-o", "no_folder/new.mcap"), ("no_folder",)),
    (("simulate", "demo_turn_milling", "-o", "new.mcap", "--channels", "9"), ("channels", "9")),
    (("stability",), ("OP",)),
])
def test_bad_input_is_one_clear_line(arguments: tuple[str, ...], words: tuple[str, ...], tmp_path: Path,
                                     monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = ask(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert all(word in err for word in words)
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_existing_output_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "cut.mcap"
    there.write_bytes(b"precious")
    code, _, err = ask(capsys, "simulate", "demo_turn_milling", "-o", str(there))
    assert code == 2
    assert "exists" in err
    assert there.read_bytes() == b"precious"


def test_lobes_writes_the_same_files_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """PNG, CSV and JSON, byte for byte; and the HTML page."""
    files = {}
    for number in (1, 2):
        names = [tmp_path / f"{number}.{kind}" for kind in ("png", "csv", "html")]
        code, out, err = ask(
            capsys, "lobes", "milling_benchmark_2dof", "--tool-speeds", "5000rpm..9000rpm", "--deepest", "1mm",
            "--points", "8x6", "--json", "--png", str(names[0]), "--csv", str(names[1]), "--report", str(names[2]))
        assert (code, err) == (0, "")
        files[number] = (out, names[0].read_bytes(), names[1].read_bytes())
        assert "tool speed [rpm]" in names[2].read_text()
    assert files[1] == files[2]
    found = json.loads(files[1][0])
    assert len(found["diagrams"][0]["spectral_radius"]) == 6
    assert len(found["tool_speeds_rad_s"]) == 8
    assert files[1][2].count(b"\n") == 49
    assert files[1][1].startswith(b"\x89PNG")


def test_lobes_over_several_workpiece_speeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, "lobes", "thesis_table_4_9", "--tool-speeds", "3000rpm..4000rpm", "--deepest", "4mm",
                       "--workpiece-speeds", "6rpm,21rpm,40rpm", "--kind", "boundary", "--points", "3x2", "--json",
                       "--png", str(tmp_path / "a.png"), "--csv", str(tmp_path / "a.csv"))
    parts = json.loads(out)["diagrams"]
    assert code == 0
    assert [round(p["workpiece_speed_rad_s"] * 30 / 3.14159265) for p in parts] == [6, 21, 40]
    assert all(len(p["stable_depths_m"]) == 3 for p in parts)
    assert "stable from [mm]" in (tmp_path / "a.csv").read_text()


def test_delay_shows_every_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, "delay", "thesis_table_4_9", "--workpiece-speed", "21rpm", "--json",
                       "--report", str(tmp_path / "delay.html"))
    found = json.loads(out)
    assert code == 0
    assert set(found["delay_s"]) == {
        "milling", "mean", "discrete-literal", "discrete-consistent", "first-principles", "exact"}
    assert found["delay_s"]["mean"][0] == pytest.approx(60 / 3350 / 2 * (1 + 21 / 3350))
    assert "tool speed / workpiece speed" in (tmp_path / "delay.html").read_text()


@pytest.mark.parametrize(("arguments", "word"), [
    (("lobes", "thesis_table_4_9", "--tool-speeds", "2000rpm"), "FROM..TO"),
    (("lobes", "thesis_table_4_9", "--tool-speeds", "2000rpm..1000rpm"), "TO above FROM"),
    (("lobes", "thesis_table_4_9", "--points", "200y100"), "200x100"),
    (("lobes", "thesis_table_4_9", "--deepest", "60mm"), "radius"),
    (("delay", "milling_benchmark_1dof"), "turn-milling"),
    (("stability", "thesis_table_4_9", "--samples", "-1"), "--samples"),
])
def test_impossible_stability_questions(
    arguments: tuple[str, ...], word: str, capsys: pytest.CaptureFixture[str],
) -> None:
    code, _, err = ask(capsys, *arguments)
    assert code == 2
    assert word in err
    assert err.count("\n") == 1


def test_low_speed_shows_three_curves_and_warns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("lobes", "thesis_table_4_11", "--low-speed", "--tool-speeds", "1200rpm..2100rpm", "--points", "4x2",
                 "--deepest", "4mm")
    code, out, err = ask(capsys, *arguments, "--report", str(tmp_path / "a.html"), "--png", str(tmp_path / "a.png"))
    assert (code, err) == (0, "")
    assert "warning: radial immersion is 0.40" in out
    assert "envelope through two trials" in (tmp_path / "a.html").read_text()
    low = json.loads(ask(capsys, *arguments, "--json")[1])["low_speed"]
    assert low["envelope_limit_m"] == pytest.approx(0.2312e-3, rel=1e-3)
    assert len(low["envelope_m"]) == len(low["limit_with_process_damping_m"]) == 4
