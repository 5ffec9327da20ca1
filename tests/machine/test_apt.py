"""APT-CL files: what is read, what is refused and how, round trips, and files that no one would write."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnmill_core.machine.apt import AptFile, UnknownWord, read_apt
from turnmill_core.machine.apt_writer import COLUMNS, write_apt
from turnmill_core.machine.toolpath import PathPoint, Toolpath, with_workpiece_speed

RPM = math.pi / 30
SAMPLE = """\
$$ made by hand
PARTNO/SHAFT 12
MACHIN/NT3150,1
UNITS/MM
MULTAX
LOADTL/3,ADJUST,1
CUTTER/20.0,2.0,8.0,2.0,0.0,0.0,75.0
SPINDL/RPM,3350.0,CLW
PPRINT/WORKPIECE SPEED 6.0 RPM
PPRINT/first pass
FROM/50.0,0.0,12.0,1.0,0.0,0.0
RAPID
goto/24.0, 0.0, 12.0  $$ into depth
FEDRAT/8.0,MMPR
GOTO/24.0,0.0,$ the rest is a remark
  -30.0,1.0,$
  0.0,0.0
COOLNT/OFF
CYCLE/DRILL,5.0
VENDOR/SOMETHING
FEDRAT/MMPM,250.
GOTO/30.0,0.0,-30.0,.7071068,0.0,.7071068
VENDOR/ELSE
SPINDL/OFF
FINI
"""


def test_the_sample() -> None:
    found = read_apt(SAMPLE, "sample.cls")
    points = found.path.points
    assert found.path.tips == pytest.approx(np.array(
        [(0.05, 0.0, 0.012), (0.024, 0.0, 0.012), (0.024, 0.0, -0.03), (0.03, 0.0, -0.03)]))
    assert [p.rapid for p in points] == [True, True, False, False]
    assert [p.feed for p in points] == pytest.approx([0, 0, 0.008, 0.25 / 60])
    assert [p.feed_per for p in points] == ["time", "time", "revolution", "time"]
    assert all(p.tool == 3 and p.tool_speed == pytest.approx(3350 * RPM) for p in points)
    assert all(p.workpiece_speed == pytest.approx(6 * RPM) for p in points)
    assert [p.axis for p in points[:3]] == [(1.0, 0.0, 0.0)] * 3
    assert points[3].axis == pytest.approx((math.sqrt(0.5), 0, math.sqrt(0.5)), abs=1e-15)
    assert found.path.cutters == ((0, pytest.approx((0.02, 0.002, 0.008, 0.002, 0.0, 0.0, 0.075))),)
    assert found.path.notes == ((0, "first pass"),)
    assert found.unknown == (UnknownWord("CYCLE", 1, (19,), True), UnknownWord("VENDOR", 2, (20, 23), False))


def test_line_ends_and_inches() -> None:
    text = "UNITS/INCHES\r\nFEDRAT/10\rGOTO/1,2,-3\nFEDRAT/IPR,.01\nSPINDL/500\nGOTO/0,0,0\n"
    first, second = read_apt(text).path.points
    assert first.tip == pytest.approx((0.0254, 0.0508, -0.0762))
    assert first.axis == (0.0, 0.0, 1.0)
    assert first.feed == pytest.approx(10 * 0.0254 / 60)
    assert (second.feed, second.feed_per) == (pytest.approx(0.01 * 0.0254), "revolution")


def test_spindle_words() -> None:
    text = "SPINDL/600,RPM,CCLW\nGOTO/0,0,0\nSPINDL/OFF\nGOTO/0,0,0\nSPINDL/ON\nGOTO/0,0,0\nSPINDL/300\nGOTO/1.D1,0,0"
    points = read_apt(text).path.points
    assert [p.tool_speed / RPM for p in points] == pytest.approx([-600, 0, -600, -300])
    assert points[-1].tip[0] == 0.01


@pytest.mark.parametrize(("line", "words"), [
    ("GOTO/1,2", "2 values, expected x, y, z"),
    ("GOTO", "0 values"),
    ("GOTO/1,2,x", "'X' is not a number"),
    ("GOTO/1,2,nan", "'NAN' is not a number"),
    ("GOTO/1,2,1e999", "too large"),
    ("GOTO/1,2,1e9", "beyond 1000 m"),
    ("GOTO/1,2,3,0,0,0", "length 0, expected 1"),
    ("GOTO/1,2,3,1,1,0", "length 1.41421, expected 1"),
    ("FEDRAT/-100,MMPM", "feed is -100, expected a number > 0"),
    ("FEDRAT/0,MMPM", "feed is 0"),
    ("FEDRAT/100,FURLONGS", "expected a feed and MMPM"),
    ("FEDRAT/MMPM", "expected a feed"),
    ("SPINDL/-5,CLW", "spindle speed is -5 rpm"),
    ("SPINDL/100,SMM", "expected a speed, RPM"),
    ("SPINDL/100,CLW,CCLW", "expected a speed, RPM"),
    ("LOADTL/1.5", "whole number"),
    ("LOADTL", "whole number"),
    ("LOAD/WIRE", "expected TOOL"),
    ("CUTTER/0", "cutter diameter is 0"),
    ("CUTTER/1,2,3,4,5,6,7,8", "8 values"),
    ("UNITS/CUBITS", "expected one of MM"),
    ("MULTAX/MAYBE", "expected nothing, ON or OFF"),
    ("PPRINT/WORKPIECE SPEED fast", "a number and RPM"),
    ("GOTO/1,2,$", "beyond the end of the file"),
])
def test_known_words_that_make_no_sense(line: str, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("(", r"\(")) as error:
        read_apt(f"$$ x\nGOTO/0,0,0\n{line}", "bad.cls")
    assert str(error.value).startswith("bad.cls, line 3: ")
    assert line.split("$")[0].split(",")[0] in str(error.value)


def test_a_file_without_points() -> None:
    with pytest.raises(ValueError, match=r"none.cls: no GOTO or FROM in 2 lines"):
        read_apt("PARTNO/x\n", "none.cls")


def assert_same(found: AptFile, path: Toolpath) -> None:
    assert found.unknown == ()
    assert len(found.path.points) == len(path.points)
    for a, b in zip(found.path.points, path.points, strict=True):
        assert a.tip == pytest.approx(b.tip, abs=1e-12)
        assert a.axis == pytest.approx(b.axis, abs=2e-15)
        assert (a.tool_speed, a.workpiece_speed, a.feed) == pytest.approx(
            (b.tool_speed, b.workpiece_speed, b.feed), rel=1e-14)
        assert (a.rapid, a.tool) == (b.rapid, b.tool)
        assert a.feed_per == b.feed_per or b.feed == 0
    assert [(i, pytest.approx(v, rel=1e-13)) for i, v in path.cutters] == list(found.path.cutters)
    assert found.path.notes == path.notes


def test_the_sample_is_written_and_read_back() -> None:
    path = read_apt(SAMPLE).path
    text = write_apt(path)
    assert_same(read_apt(text), path)
    assert max(map(len, text.splitlines())) <= COLUMNS
    assert write_apt(read_apt(text, "<text>").path) == text


coordinates = st.floats(-5, 5)
speeds = st.one_of(st.just(0.0), st.floats(-2000, 2000).filter(lambda x: abs(x) > 1e-3))


@st.composite
def points(draw: st.DrawFn) -> PathPoint:
    a, b = draw(st.floats(0, math.pi)), draw(st.floats(-math.pi, math.pi))
    return PathPoint(
        (draw(coordinates), draw(coordinates), draw(coordinates)),
        (math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)),
        draw(st.floats(1e-6, 1.0)), draw(st.sampled_from(["time", "revolution"])), draw(speeds), draw(speeds),
        draw(st.booleans()), draw(st.integers(0, 99)))


@st.composite
def paths(draw: st.DrawFn) -> Toolpath:
    found = tuple(draw(st.lists(points(), min_size=1, max_size=8)))
    places = st.integers(0, len(found))
    cutters = draw(st.lists(st.tuples(places, st.lists(st.floats(1e-4, 0.5), min_size=1, max_size=7).map(tuple)),
                            max_size=2))
    texts = st.text(st.characters(codec="ascii", exclude_characters="$", categories=["L", "N", "P", "Zs"]),
                    min_size=1, max_size=30).map(lambda t: " ".join(t.split()))
    notes = draw(st.lists(st.tuples(places, texts.filter(
        lambda t: t and not t.upper().startswith("WORKPIECE SPEED"))), max_size=2))
    return Toolpath(found, "p", tuple(sorted(cutters, key=lambda c: c[0])), tuple(sorted(notes, key=lambda n: n[0])))


@settings(max_examples=100, deadline=None)
@given(paths())
def test_any_path_is_written_and_read_back(path: Toolpath) -> None:
    assert_same(read_apt(write_apt(path)), path)


WORDS = st.sampled_from(["GOTO", "FROM", "FEDRAT", "SPINDL", "RAPID", "LOADTL", "LOAD", "CUTTER", "UNITS", "MULTAX",
                         "PPRINT", "PARTNO", "CYCLE", "goto", "GODLTA", "P1=POINT", ""])
ARGUMENTS = st.one_of(
    st.floats().map(str), st.integers().map(str), st.sampled_from(
        ["MMPM", "MMPR", "IPM", "CLW", "CCLW", "RPM", "ON", "OFF", "MM", "INCHES", "TOOL", "WORKPIECE SPEED 3 RPM",
         "WORKPIECE SPEED 1E400 RPM", "0", "1", "-1", "1.D400", "$", "$$", "0.6", "0.8", "٣", "\x00"]),
    st.text(max_size=6))
LINES = st.one_of(
    st.builds(lambda w, s, a: f"{w}{s}{','.join(a)}", WORDS, st.sampled_from(["/", "", " / ", "//"]),
              st.lists(ARGUMENTS, max_size=8)),
    st.builds(lambda v: f"GOTO/{','.join(map(str, v))}", st.lists(st.integers(-1, 1), min_size=3, max_size=6)),
    st.text(max_size=40))
FILES = st.lists(LINES, max_size=25).map("\n".join)


def read_or_refuse(text: str) -> None:
    """A file is read, or refused with a ValueError of one line; what was read can be written and read again."""
    try:
        found = read_apt(text, "file")
    except ValueError as error:
        said = str(error)
    else:
        said = ""
    if said:
        assert said.startswith("file")
        assert len(said) < 400
        return
    assert found.path.points
    assert sum(w.count for w in found.unknown) <= text.count("\n") + text.count("\r") + 1
    if all(p.feed for p in found.path.points):
        read_apt(write_apt(found.path))


@settings(max_examples=300, deadline=None)
@given(FILES)
def test_no_file_breaks_the_reader(text: str) -> None:
    read_or_refuse(text)


@pytest.mark.slow
@settings(max_examples=10_000, deadline=None)
@given(FILES)
def test_ten_thousand_files_do_not_break_the_reader(text: str) -> None:
    read_or_refuse(text)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_damaged_samples_do_not_break_the_reader(data: st.DataObject) -> None:
    text = SAMPLE
    for _ in range(data.draw(st.integers(1, 4))):
        a = data.draw(st.integers(0, len(text)))
        text = text[:a] + data.draw(st.text(max_size=3)) + text[a + data.draw(st.integers(0, 8)):]
    read_or_refuse(text)


@pytest.mark.parametrize(("values", "words"), [
    ({"tip": (math.nan, 0.0, 0.0)}, "tool tip"),
    ({"axis": (0.0, 0.0, 1.1)}, "tool axis"),
    ({"feed": -1.0}, "feed"),
    ({"tool_speed": math.inf}, "tool speed"),
    ({"workpiece_speed": math.nan}, "workpiece speed"),
    ({"tool": -1}, "tool number"),
])
def test_points_that_cannot_exist(values: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PathPoint(**{"tip": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0), **values})  # type: ignore[arg-type]


def test_paths_that_cannot_exist() -> None:
    point = PathPoint((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    for values, words in (({"points": ()}, "at least one point"), ({"cutters": ((2, (0.01,)),)}, "index of a cutter"),
                          ({"cutters": ((0, (0.0,)),)}, "cutter"), ({"notes": ((-1, "a"),)}, "index of a note"),
                          ({"notes": ((0, "a$b"),)}, "note is")):
        with pytest.raises(ValueError, match=words):
            Toolpath(**{"points": (point,), **values})  # type: ignore[arg-type]


def test_a_feed_that_goes_missing_cannot_be_written() -> None:
    point = PathPoint((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="feed of path point 2"):
        write_apt(Toolpath((point, PathPoint((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))))


def test_the_workpiece_speed_can_be_given_to_a_file_that_has_none() -> None:
    path = with_workpiece_speed(read_apt("GOTO/0,0,0\nGOTO/1,0,0").path, -3.0)
    assert [p.workpiece_speed for p in path.points] == [-3.0, -3.0]
