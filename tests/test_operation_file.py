"""Operation files: units, keys, bounds; every problem is one line, never a traceback."""

from __future__ import annotations

import hashlib
import json
import math
import pickle
from pathlib import Path
from random import Random

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from turnmill_core.operation import Operation
from turnmill_core.operation_file import (
    OperationError,
    describe,
    operation_schema,
    parse_operation,
    read_operation,
    shipped_operations,
)

BAR = shipped_operations()["thesis_table_4_9"].read_text(encoding="utf-8")
BLOCK = shipped_operations()["milling_benchmark_1dof"].read_text(encoding="utf-8")
SCHEDULE = """
schedule:
  - {time: 0 s, tool_speed: 3350 rpm, workpiece_speed: 6 rpm, depth: -1 mm}
  - {time: 500 ms, tool_speed: 3350 rpm, workpiece_speed: 21 rpm, depth: 1.2 mm}
"""
MILLING_SCHEDULE = """
schedule:
  - {time: 0 s, tool_speed: 5000 rpm, depth: -1 mm}
  - {time: 2 s, tool_speed: 6000 rpm, depth: 0.2 mm}
"""


def edited(text: str, *changes: tuple[str, str]) -> str:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def problem(text: str) -> OperationError:
    with pytest.raises(OperationError) as caught:
        parse_operation(text, "cut.yaml")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("cut.yaml: ")
    return caught.value


def test_text_and_hash_are_kept_byte_for_byte(tmp_path: Path) -> None:
    path = tmp_path / "cut µ.yaml"
    data = BAR.replace("\n", "\r\n").encode("utf-8")
    path.write_bytes(data)
    op = read_operation(path)
    assert op.text.encode("utf-8") == data
    assert op.sha256 == hashlib.sha256(data).hexdigest()
    assert parse_operation(op.text) == op


def test_schedule_and_optional_keys() -> None:
    tool = "flute_length: 30 mm\n  pitch_angles: [170 deg, 190 deg]\n  runout: [0 um, -12 um]"
    text = edited(
        BAR + SCHEDULE, ("helix_angle: 25 deg", tool),
        ("length: 125 mm", "length: 125 mm\n  datum: [1 mm, 0 mm, -2 mm]"),
        ("direction: y, frequency: 776 Hz", "shape: [0, 0.6, -0.8], frequency: 776 Hz"),
    )
    op = parse_operation(text)
    assert op.tool.helix_angle == 0
    assert op.tool.flute_length == 0.03
    assert op.tool.pitch == pytest.approx((math.radians(170), math.radians(190)))
    assert op.tool.runout == pytest.approx((0, -12e-6))
    assert op.workpiece.datum == pytest.approx((1e-3, 0, -2e-3))
    assert op.tool.structure.modes[2].shape == (0.0, 0.6, -0.8)
    assert [p.time for p in op.schedule] == [0, 0.5]
    assert op.schedule[0].depth == pytest.approx(-1e-3)
    assert op.schedule[1].workpiece_speed == pytest.approx(21 * math.pi / 30)


@pytest.mark.parametrize(
    ("sense", "span"),
    [("sense: up\n  radial_immersion: 2 mm", (3e-3, 5e-3)), ("sense: down\n  radial_immersion: 2 mm", (-5e-3, -3e-3)),
     ("sense: slot", (-5e-3, 5e-3)), ("sense: slot\n  radial_immersion: 10 mm", (-5e-3, 5e-3))],
)
def test_milling_immersion(sense: str, span: tuple[float, float]) -> None:
    assert parse_operation(edited(BLOCK, ("sense: slot", sense))).conditions.cross_feed_span == pytest.approx(span)


def test_centred_face_mill_cuts_the_block_width() -> None:
    op = parse_operation(edited(BLOCK, ("sense: slot", "sense: centred"), ("width: 40 mm", "width: 8 mm")))
    assert op.conditions.cross_feed_span == (-4e-3, 4e-3)


def test_down_turn_milling_mirrors_the_span() -> None:
    assert parse_operation(edited(BAR, ("sense: up", "sense: down"))).conditions.cross_feed_span == pytest.approx(
        (-10e-3, -2e-3))


BAD = [
    # change, key, words
    (("diameter: 20 mm", "diameter: 20"), "tool.diameter", ["is 20,", "length", "unit is missing"]),
    (("diameter: 20 mm", "diameter: 20 s"), "tool.diameter", ["'20 s'", "wrong unit s"]),
    (("diameter: 20 mm", "diameter: -20 mm"), "tool.diameter", ["'-20 mm'", "> 0"]),
    (("diameter: 20 mm", "diameter:"), "tool.diameter", ["is None"]),
    (("diameter: 20 mm", "diamter: 20 mm"), "tool.diamter", ["not a known key", "did you mean diameter"]),
    (("  diameter: 20 mm\n", ""), "tool.diameter", ["missing", "diameter", "20 mm"]),
    (("teeth: 2", "teeth: 2.5"), "tool.teeth", ["2.5", "integer"]),
    (("teeth: 2", "teeth: 0"), "tool.teeth", ["0", "greater than or equal to 1"]),
    (("teeth: 2", "teeth: true"), "tool.teeth", ["True", "integer"]),
    (("teeth: 2", "teeth: 1000000000"), "tool.teeth", ["200"]),
    (("helix_angle: 25 deg", "helix_angle: 25"), "tool.helix_angle", ["angle", "25 deg"]),
    (("helix_angle: 25 deg", "helix_angle: 95 deg"), "tool", ["helix angle", "pi/2"]),
    (("helix_angle: 25 deg", "runout: [1 um]"), "tool", ["runout", "2 finite"]),
    (("helix_angle: 25 deg", "pitch_angles: [100 deg, 100 deg]"), "tool", ["pitch angles", "2 pi"]),
    (("frequency: 800 Hz", "frequency: 800 rpm"), "tool.structure.modes[1].frequency", ["'800 rpm'", "frequency"]),
    (("damping: 5.32 %", "damping: 5.32"), "tool.structure.modes[0].damping", ["5.32", "ratio", "5.32 %"]),
    (("damping: 5.32 %", "damping: 532 %"), "tool.structure.modes[0]", ["below 100 %"]),
    (("direction: y", "direction: q"), "tool.structure.modes[2].direction", ["'q'", "'x', 'y', 'z', 'u', 'v'"]),
    (("direction: y, ", ""), "tool.structure.modes[2]", ["either direction"]),
    (("direction: y", "direction: y, shape: [0, 1, 0]"), "tool.structure.modes[2]", ["either direction"]),
    (("direction: y", "shape: [0, 1]"), "tool.structure.modes[2].shape[2]", ["missing"]),
    (("direction: y", "shape: [0, 1, 2, 3]"), "tool.structure.modes[2].shape", ["at most 3 items"]),
    (("direction: y", "shape: [0, 0, 0]"), "tool.structure.modes[2]", ["mode shape", "not all zero"]),
    (("direction: y", "shape: [0, .nan, 0]"), "tool.structure.modes[2].shape[1]", ["finite"]),
    (("frame: tool", "frame: workpiece"), "tool.structure.frame", ["'machine', 'tool' or 'rotating'"]),
    (("    frame: tool\n", ""), "tool.structure.frame", ["missing", "machine, tool"]),
    (("length: 125 mm", "length: 125 mm\n  width: 3 mm"), "workpiece.width", ["not a known key"]),
    (("Ktc: 930 MPa", "Ktc: 930"), "material.Ktc", ["930", "MPa"]),
    (("Ktc: 930 MPa", "Ktc: 930 N/mm"), "material.Ktc", ["wrong unit N/mm"]),
    (("axial_feed: 8 mm/rev", "axial_feed: 8 mm"), "cut.axial_feed", ["'8 mm'", "mm/rev"]),
    (("axial_feed: 8 mm/rev", "axial_feed: 12 mm/rev"), "cut.axial_feed", ["12 mm/rev", "tool radius, 10 mm/rev"]),
    (("workpiece_speed: 6 rpm", "workpiece_speed: 0 rpm"), "cut.workpiece_speed", ["other than 0"]),
    (("tool_speed: 3350 rpm", "tool_speed: 55.8 Hz"), "cut.tool_speed", ["angular speed", "wrong unit Hz"]),
    (("depth: 1.2 mm", "depth: 23 mm"), "cut.depth", ["23 mm", "bar's radius 23 mm"]),
    (("depth: 1.2 mm", "depth: 0 mm"), "cut.depth", ["> 0"]),
    (("helix_angle: 25 deg", "flute_length: 1 mm"), "cut.depth", ["1.2 mm", "flute length 1 mm"]),
    (("sense: up", "sense: slot"), "cut.sense", ["'up' or 'down'"]),
    (("process: turn-milling", "process: turning"), "process", ["'turning'", "milling or turn-milling"]),
    (("process: turn-milling", "process: [1]"), "process", ["milling or turn-milling"]),
    (("process: turn-milling\n", ""), "process", ["missing"]),
    (("schema: 1", "schema: 2"), "schema", ["is 2", "expected 1"]),
    (("schema: 1", "schema: true"), "schema", ["is True", "expected 1"]),
    (("schema: 1\n", ""), "schema", ["missing"]),
    (("machine: Mori", "machine: 3 #"), "machine", ["is 3", "string"]),
    (("tool:\n", "tool: 5\nother:\n"), "other", ["not a known key"]),
    (("\nname:", "\nname: x\nnam:"), "nam", ["not a known key", "did you mean name"]),
    (("\nname:", "\nname: x\nno:"), "key False", ["not a text"]),
    (("schema: 1", 'schema: 1\n"a\\e[2J b": 8'), "'a\\x1b[2J b'", ["not a known key"]),
    (("schema: 1", "schema: 1\n7: 8"), "key 7", ["not a text"]),
    (("  teeth: 2", "  teeth: 2\n  teeth: 3"), "", ["line", "'teeth' stands twice"]),
    (("machine: Mori", "machine: *s # Mori"), "", ["aliases"]),
    (("machine: Mori", "machine: {a"), "", ["not valid YAML", "line"]),
    (("machine: Mori", "machine: !!timestamp x #"), "", ["not valid YAML", "tag"]),
    (("machine: Mori", "machine: !!bool x #"), "", ["not valid YAML", "tag"]),
    (("machine: Mori", "machine: 0b_ #"), "", ["not valid YAML"]),
    (("machine: Mori", "machine: !!python/object/apply:os.system [ls] #"), "", ["not valid YAML"]),
    (("machine: Mori", "machine: \x07"), "", ["not valid YAML"]),
    (("machine: Mori", "machine: " + "[" * 5000), "", ["not valid YAML"]),
]


@pytest.mark.parametrize(("change", "key", "words"), BAD)
def test_a_bad_bar_file_is_one_line(change: tuple[str, str], key: str, words: list[str]) -> None:
    error = problem(edited(BAR, change))
    assert error.key == key
    for word in words:
        assert word in str(error)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        (("sense: slot", "sense: up"), "cut.radial_immersion", ["missing"]),
        (("sense: slot", "sense: up\n  radial_immersion: 12 mm"), "cut.radial_immersion", ["12 mm", "diameter 10 mm"]),
        (("sense: slot", "sense: slot\n  radial_immersion: 9 mm"), "cut.radial_immersion", ["9 mm", "in a slot"]),
        (("sense: slot", "sense: centred\n  radial_immersion: 9 mm"), "cut.radial_immersion", ["block's width 40 mm"]),
        (("width: 40 mm", "width: 5 mm"), "cut.radial_immersion", ["block's width 5 mm"]),
        (("depth: 0.2 mm", "depth: 31 mm"), "cut.depth", ["31 mm", "height 30 mm"]),
        (("depth: 0.2 mm", "depth: 0.2 mm\n  workpiece_speed: 1 rpm"), "cut.workpiece_speed", ["not a known key"]),
        (("length: 400 mm", "diameter: 400 mm\n  length: 400 mm"), "workpiece.diameter", ["not a known key"]),
    ],
)
def test_a_bad_block_file_is_one_line(change: tuple[str, str], key: str, words: list[str]) -> None:
    error = problem(edited(BLOCK, change))
    assert error.key == key
    for word in words:
        assert word in str(error)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        (("time: 500 ms", "time: 0 s"), "schedule[1].time", ["a time after 0 s"]),
        (("time: 500 ms", "time: 0.5"), "schedule[1].time", ["unit is missing"]),
        (("time: 500 ms", "time: -1 s"), "schedule[1].time", [">= 0"]),
        (("depth: -1 mm", "depth: 30 mm"), "schedule[0].depth", ["30 mm", "bar's radius"]),
        (("tool_speed: 3350 rpm, workpiece_speed: 21 rpm", "workpiece_speed: 21 rpm"), "schedule[1].tool_speed",
         ["missing"]),
    ],
)
def test_a_bad_schedule_is_one_line(change: tuple[str, str], key: str, words: list[str]) -> None:
    error = problem(edited(BAR + SCHEDULE, change))
    assert error.key == key
    for word in words:
        assert word in str(error)


def test_a_schedule_has_two_points_or_none() -> None:
    assert problem(BAR + SCHEDULE[: SCHEDULE.index("  - {time: 500")]).key == "schedule"
    assert parse_operation(BAR + "\nschedule: []\n").schedule == ()
    assert len(parse_operation(BLOCK + MILLING_SCHEDULE).schedule) == 2
    assert problem(BLOCK + SCHEDULE).key == "schedule[0].workpiece_speed"


@pytest.mark.parametrize("text", ["", "# only a comment\n", "5", "[]", "- a\n- b", "null", "a: 1\n---\nb: 2", "\x00"])
def test_texts_that_are_no_mapping(text: str) -> None:
    assert problem(text).key == "" or "schema" in str(problem(text))


def test_dates_are_texts() -> None:
    assert parse_operation(edited(BAR, ("machine: Mori", "machine: 2020-13-45 #"))).machine == "2020-13-45"


@given(st.randoms(use_true_random=False))
def test_a_damaged_text_is_read_or_refused_in_one_line(random: Random) -> None:
    text = random.choice([BAR + SCHEDULE, BLOCK + MILLING_SCHEDULE])
    for _ in range(random.randint(1, 4)):
        i, j = random.randrange(len(text)), random.randrange(len(text))
        pieces = ["", "!!bool x", "*a", "&a", "{", "]", "- ", "\n", "1e999 mm", "\x85", "0b_", text[j : j + 30]]
        piece = random.choice(pieces)
        text = text[:i] + piece + text[i + random.randint(0, 12) :]
    try:
        error = ""
        parse_operation(text, "cut.yaml")
    except OperationError as caught:
        error = str(caught)
    assert len(error.splitlines()) <= 1
    assert len(error) < 800


def test_unreadable_files(tmp_path: Path) -> None:
    not_utf8, large = tmp_path / "latin.yaml", tmp_path / "large.yaml"
    not_utf8.write_bytes(BAR.encode("utf-8") + b"\n# \xe9\n")
    large.write_bytes(b"#" * 2_000_000)
    for path, words in ((tmp_path / "none.yaml", "No such file"), (tmp_path, "directory"), (not_utf8, "not UTF-8"),
                        (large, "larger"), ("a\0b", "cannot be read")):
        with pytest.raises(OperationError, match=words) as caught:
            read_operation(path)
        assert str(path).replace("\n", " ") in str(caught.value)


def test_an_error_survives_pickling() -> None:
    error = problem("")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
    | st.sampled_from(["20 mm", "3 rpm", "tool"])
)
KEYS = st.sampled_from(["tool", "cut", "diameter", "modes", "structure", "schedule", "name"]) | st.text(max_size=4)
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4), max_leaves=12)


@given(VALUES, st.sampled_from(["tool", "workpiece", "cut", "schedule", "material", "name", "sources"]))
def test_any_value_in_any_place_is_read_or_refused_in_one_line(value: object, key: str) -> None:
    def outcome(text: str) -> Operation | str:
        try:
            return parse_operation(text, "cut.yaml")
        except OperationError as error:
            return str(error)

    data = yaml.safe_load(BAR)
    data[key] = value
    result = outcome(yaml.safe_dump(data))
    assert isinstance(result, Operation) or (result.startswith("cut.yaml: ") and "\n" not in result)


def test_json_schema_describes_every_key() -> None:
    schema = operation_schema()
    assert json.loads(json.dumps(schema))["$schema"].startswith("https://json-schema.org/")
    definitions = schema["$defs"]
    assert {"ToolSection", "BarSection", "BlockSection", "MillingCut", "TurnMillingCut"} <= set(definitions)
    for name, node in definitions.items():
        for key, child in node["properties"].items():
            assert {"description", "$ref", "const"} & set(child), f"{name}.{key}"
        assert node["additionalProperties"] is False
    speed = definitions["TurnMillingCut"]["properties"]["tool_speed"]
    assert (speed["type"], speed["x-unit"], speed["examples"]) == ("string", "rad/s", ["3350 rpm"])


def test_docs_name_every_key_and_unit() -> None:
    text = (Path(__file__).parent.parent / "docs" / "operation.md").read_text(encoding="utf-8")
    for node in operation_schema()["$defs"].values():
        for key in node["properties"]:
            assert f"`{key}`" in text, key


def test_describe_gives_units_people_know() -> None:
    sections = {title: dict(rows) for title, rows in describe(parse_operation(BAR + SCHEDULE))}
    assert sections["cut"]["tool speed"] == "3350 rpm"
    assert sections["cut"]["axial feed"] == "8 mm/rev"
    assert sections["cut"]["radial immersion"] == "8 mm (40 % of the diameter)"
    assert sections["tool"]["mode 1 in x"].startswith("682 Hz, 5.32 %, 1.303 kg")
    assert sections["derived"]["tooth passing frequency"] == "111.667 Hz"
    assert sections["schedule"]["0.5 s"] == "tool 3350 rpm, workpiece 21 rpm, depth 1.2 mm"
    for path in shipped_operations().values():
        for title, rows in describe(read_operation(path)):
            assert title
            assert all(isinstance(k, str) and isinstance(v, str) and v for k, v in rows)
