"""The command toolpath, its pictures, and machine descriptions."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from tests.test_cli import ask
from turnmill_core.machine.kinematics import NT3150
from turnmill_core.machine.limits import NT3150_LIMITS
from turnmill_ros.errors import InputError
from turnmill_ros.machine_file import read_machine

FIVE_AXIS = """\
PARTNO/IMPELLER
FROM/50,0,20,0,0,1
FEDRAT/MMPM,600
GOTO/40,0,0,0.5,0,0.8660254
GOTO/40,10,0,0.3,0.4,0.8660254
CIRCLE/1,2,3
GOTO/0,40,0,0,0.5,0.8660254
"""


@pytest.mark.parametrize("kind", ["orthogonal", "tangential", "coaxial", "curved"])
def test_a_generated_path_is_written_read_back_and_drawn(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    apt, html = tmp_path / "path.cls", tmp_path / "path.html"
    options = ("--set", "tool.flute_length=30 mm") if kind == "tangential" else ()
    code, out, err = ask(capsys, "toolpath", "--generate", kind, *options, "--workpiece-speed", "-4rpm",
                         "--write", str(apt), "--report", str(html), "--json")
    made = json.loads(out)
    assert (code, err) == (0, "")
    assert made["within_strokes"]
    assert made["points"][-1]["c_rad"] == pytest.approx(-4 * math.pi / 30 * made["duration_s"])
    page = html.read_text()
    assert f"{kind} turn-milling" in page
    assert all(words in page for words in ("Slides", "Tool head B", "Workpiece spindle C", "Path seen along y"))
    again = json.loads(ask(capsys, "toolpath", str(apt), "--json")[1])
    assert again["unknown_words"] == []
    assert again["duration_s"] == pytest.approx(made["duration_s"], rel=1e-9)
    for a, b in zip(again["points"], made["points"], strict=True):
        assert a["slides_m"] == pytest.approx(b["slides_m"], abs=1e-11)


def test_a_five_axis_file_as_table_and_states(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "impeller.cls"
    file.write_text(FIVE_AXIS)
    code, out, _ = ask(capsys, "toolpath", str(file))
    assert code == 0
    assert "CIRCLE" in out
    assert "-90.000" in out
    assert "within the strokes" in out
    found = json.loads(ask(capsys, "toolpath", str(file), "--json", "--rate", "10Hz", "--tool-length", "100mm")[1])
    assert found["unknown_words"] == [{"word": "CIRCLE", "count": 1, "lines": [6], "changes_path": True}]
    assert found["points"][1]["b_rad"] == pytest.approx(math.radians(30), abs=1e-7)
    assert found["points"][1]["slides_m"] == pytest.approx(
        [0.04 + 0.1 * math.sin(math.radians(30)), 0, 0.1 * math.cos(math.radians(30))], abs=1e-8)
    assert len(found["axis_states"]) == math.floor(found["duration_s"] * 10) + 1
    assert found["axis_states"][0]["position"] == pytest.approx([0.05, 0, 0.02, 0, 0, 0])


def test_outside_the_strokes_is_shown_and_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "far.cls"
    file.write_text("FEDRAT/100\nGOTO/0,0,0\nGOTO/0,130,0\n")
    code, out, err = ask(capsys, "toolpath", str(file), "--json")
    assert code == 2
    assert "path point 2: axis Y at 130 mm, expected -125 to 125 mm (1 point outside)" in err
    assert json.loads(out)["violation"].startswith("path point 2: axis Y")
    machine = tmp_path / "wide.yaml"
    machine.write_text("name: wide\nstrokes: {y: [-200 mm, 200 mm]}\n")
    assert ask(capsys, "toolpath", str(file), "--machine", str(machine))[0] == 0


@pytest.mark.parametrize(("arguments", "words"), [
    ((), ("path FILE or --generate",)),
    (("x.cls", "--generate", "curved"), ("path FILE or --generate",)),
    (("x.cls",), ("x.cls", "No such file")),
    (("bad.cls",), ("bad.cls, line 2", "-5", "FEDRAT/-5,MMPM")),
    (("binary.cls",), ("binary.cls, line",)),
    (("nofeed.cls",), ("feed to path point 2",)),
    (("nofeed.cls", "--sagitta", "1mm"), ("go with --generate",)),
    (("--generate", "spiral"), ("spiral", "orthogonal")),
    (("--generate", "orthogonal", "--sagitta", "1mm"), ("--sagitta",)),
    (("--generate", "orthogonal", "--operation", "face_mill_6_teeth"), ("process", "turn-milling")),
    (("--generate", "orthogonal", "--eccentricity", "1m"), ("eccentricity", "tool radius")),
    (("--generate", "orthogonal", "--workpiece-speed", "0rpm"), ("workpiece speed",)),
    (("--generate", "orthogonal", "--rate", "5"), ("--rate", "5")),
    (("--generate", "orthogonal", "--machine", "none.yaml"), ("none.yaml", "no such machine file")),
    (("--generate", "orthogonal", "--report", "nofeed.cls"), ("exists",)),
])
def test_bad_input_is_one_line(arguments: tuple[str, ...], words: tuple[str, ...], tmp_path: Path,
                               monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.cls").write_text("GOTO/0,0,0\nFEDRAT/-5,MMPM\n")
    Path("nofeed.cls").write_text("GOTO/0,0,0\nGOTO/1,0,0\n")
    Path("binary.cls").write_bytes(bytes(range(256)) * 40)
    code, out, err = ask(capsys, "toolpath", *arguments)
    assert (code, out) == (2, "")
    assert all(word in err for word in words)
    assert err.count("\n") == 1


def test_machine_descriptions(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text("{}")
    assert read_machine(file)[0].b == NT3150.b
    assert read_machine(file)[1] == NT3150_LIMITS
    file.write_text("""\
name: nutating head
b: {direction: [0, 1, 1], point: [0 mm, 10 mm, 0 mm]}
c: {point: [1 mm, 0 mm, 0 mm]}
tool_axis: [0, 0, 1]
tool_tip: [0 mm, 0 mm, -150 mm]
workpiece_datum: [1 mm, 0 mm, 0.2 m]
strokes: {x: [0 mm, 800 mm], b: null, c: [-90 deg, 90 deg]}
""")
    machine, limits = read_machine(file)
    assert machine.b.direction == (0.0, 1.0, 1.0)
    assert machine.b.point == pytest.approx((0, 0.01, 0))
    assert machine.tool_tip == pytest.approx((0, 0, -0.15))
    assert limits.lower == pytest.approx((0, -0.125, -0.285, -math.inf, -math.pi / 2))
    assert limits.upper == pytest.approx((0.8, 0.125, 0.285, math.inf, math.pi / 2))


@pytest.mark.parametrize(("text", "words"), [
    ("- 1", "machine has"), ("speed: 3", "speed"), ("b: 3", "b has 3"), ("b: {direction: [0, 1]}", "b.direction"),
    ("b: {direction: [0, 1, up]}", "'up'"), ("b: {point: [0, 1, 2]}", "unit is missing"),
    ("b: {direction: [0, 0, 1]}", "not parallel"), ("strokes: {y: [1 mm]}", "strokes.y"),
    ("strokes: {y: [2 mm, 1 mm]}", "limits of drive y"), ("strokes: {q: [1 mm, 2 mm]}", "'q'"), ("{", "YAML"),
])
def test_machine_descriptions_that_make_no_sense(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"machine\.yaml") as error:
        read_machine(file)
    assert words in str(error.value)
