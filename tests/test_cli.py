"""The command line: what it prints, and what it says of bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from turnmill_ros.cli import app
from turnmill_ros.cli.app import run

COMMANDS = ("doctor", "operation", "simulate", "import", "replay", "analyze", "live", "stability", "forces", "recover",
            "toolpath", "identify")


def ask(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(list(arguments))
    text = capsys.readouterr()
    return code, text.out, text.err


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = ask(capsys, command, "--help")
    assert code == 0
    assert f"Example: turnmill {command}" in " ".join(out.split())


def test_every_command_is_tested_for_help() -> None:
    names = {c.name or c.callback.__name__ for c in app.registered_commands}
    assert names == set(COMMANDS)


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
