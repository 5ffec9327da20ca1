"""The command engagement: a cut, a path, its pictures, bad input."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from tests.test_cli import ask

BALL = """\
schema: 1
name: Ball on a stepped bar
process: turn-milling
machine: test
tool: {name: ball, diameter: 16 mm, teeth: 2, helix_angle: 25 deg, flute_length: 30 mm, shape: {corner_radius: 8 mm}}
workpiece:
  name: bar
  diameter: 60 mm
  length: 12 mm
  profile:
    - {z: 0 mm, diameter: 56 mm}
    - {z: -6 mm, diameter: 56 mm}
    - {z: -6 mm, diameter: 60 mm}
    - {z: -12 mm, diameter: 60 mm}
material: {name: Al6061-T6, Ktc: 930 MPa, Krc: 290 MPa, Kac: 242 MPa, Kte: 21 N/mm, Kre: 25 N/mm, Kae: 8 N/mm}
cut: {tool_speed: 3000 rpm, workpiece_speed: 10 rpm, depth: 3 mm, axial_feed: 2 mm/rev, sense: up}
"""


def test_a_steady_cut_as_json_and_table(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = ask(capsys, "engagement", "thesis_table_3_1", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)["map"]
    tip = next(e for e in found["elements"] if not e["bottom"])
    assert [math.degrees(a) for a in tip["arcs_rad"][0]] == pytest.approx([-0.35, 41.06], abs=0.02)
    assert found["side_m3_s"] + found["bottom_m3_s"] == pytest.approx(2.178e-8, rel=2e-3)
    code, out, _ = ask(capsys, "engagement", "thesis_table_3_1", "--depth", "0.5mm")
    assert code == 0
    assert all(words in out for words in ("-0.35 to ", "through the bottom", "mm3/min"))


def test_along_a_path_with_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    op, apt, html = tmp_path / "op.yaml", tmp_path / "path.cls", tmp_path / "map.html"
    op.write_text(BALL)
    assert ask(capsys, "toolpath", "--generate", "orthogonal", "--operation", str(op), "--write", str(apt))[0] == 0
    asked = ("engagement", str(op), "--path", str(apt), "--workpiece-speed", "10rpm", "--rate", "2Hz")
    code, out, err = ask(capsys, *asked, "--report", str(html), "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    heights = [m["contact_height_m"] for m in found["path"]]
    assert heights[0] == 0
    assert max(heights) == pytest.approx(3e-3, abs=0.1e-3)  # the thicker part of the bar
    assert any(0.8e-3 < h < 1.05e-3 for h in heights)  # the thinner one
    page = html.read_text()
    assert all(words in page for words in ("Removed per time", "Angle in the cut by height", "Engagement map",
                                           "In the cut, seen from the spindle", "corner radius"))
    code, out, _ = ask(capsys, *asked, "--at", "0s")
    assert code == 0
    assert "map at 0.000 s (no contact)" in out


@pytest.mark.parametrize(("options", "message"), [
    (("--at", "1s"), "--at, --machine, --tool-length and --rate go with --path"),
    (("--elements", "0"), "--elements"),
    (("--path", "missing.cls"), "missing.cls"),
    (("--path", "missing.cls", "--depth", "1mm"), "tool speed and depth of a path are in its file"),
    (("--depth", "200mm"), "depth is"),
])
def test_bad_questions_are_one_line(
    options: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = ask(capsys, "engagement", "thesis_table_3_1", *options)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
