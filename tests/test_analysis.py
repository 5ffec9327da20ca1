"""Offline analysis: segments, JSON, and what is said of recordings that cannot be trusted."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest

from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_ros.analysis import analysis_json, analyze, iso_time, merge, summary, timeline
from turnmill_ros.cli.output import plain
from turnmill_ros.errors import InputError

BAGS = Path(__file__).parent.parent / "bags"
HOP = 50_000_000


def verdict(step: int, state: ChatterKind, frequency: float = math.nan, stream: int = 1) -> Verdict:
    end = 1_000_000_000 + step * HOP
    return Verdict(end - 4 * HOP, end, step, "d", stream, "mic", state, Reason.NONE, "", frequency, confidence=0.5)


def test_merge_is_contiguous_and_counts_all() -> None:
    states = [ChatterKind.AIR] * 3 + [ChatterKind.HOPF] * 2 + [ChatterKind.AIR]
    segments = merge([verdict(k, s, 800.0 + k) for k, s in enumerate(states)])
    assert [s.state for s in segments] == [ChatterKind.AIR, ChatterKind.HOPF, ChatterKind.AIR]
    assert sum(s.verdicts for s in segments) == len(states)
    assert all(a.end_ns == b.start_ns for a, b in pairwise(segments))
    assert segments[1].start_ns == 1_000_000_000 + 3 * HOP
    assert segments[1].chatter_frequency == 803.5


def test_merge_leaves_holes_and_restarts_open() -> None:
    segments = merge([verdict(0, ChatterKind.STABLE), verdict(1, ChatterKind.STABLE), verdict(9, ChatterKind.UNKNOWN)])
    assert segments[0].end_ns == 1_000_000_000 + HOP
    assert len(merge([verdict(0, ChatterKind.STABLE), verdict(1, ChatterKind.STABLE, stream=2)])) == 2


def test_demo_is_air_stable_hopf_stable_near_the_truth() -> None:
    analysis = analyze(BAGS / "demo_turn_milling.mcap")
    truth = json.loads((BAGS / "demo_turn_milling.truth.json").read_text(encoding="utf-8"))
    seen = timeline(analysis.segments)
    assert [s.state.name for s in seen] == ["AIR", "STABLE", "HOPF", "STABLE"]
    rising, falling = (next(c["t_s"] for c in truth["crossings"] if c["rising"] is up) for up in (True, False))
    assert analysis.seconds(seen[2].start_ns) == pytest.approx(rising, abs=0.3)
    assert analysis.seconds(seen[2].end_ns) == pytest.approx(falling, abs=0.3)
    assert seen[2].chatter_frequency == pytest.approx(truth["chatter_frequency_hz"], rel=0.005)


def test_json_is_complete_and_plain() -> None:
    analysis = analyze(BAGS / "flip_3_teeth.mcap")
    found = json.loads(json.dumps(plain(analysis_json(analysis)), allow_nan=False))
    assert found["start_time"].endswith("Z")
    assert len(found["verdicts"]) == found["summary"]["verdict_count"]
    keys = {"t_start_s", "t_end_s", "state", "reason", "chatter_frequency_hz", "confidence"}
    assert keys <= found["verdicts"][0].keys()
    assert found["segments"][-1]["state"] == "FLIP"
    assert sum(found["summary"]["durations_s"].values()) == pytest.approx(found["segments"][-1]["t_end_s"], abs=0.01)


def test_gap_is_told_and_unknown() -> None:
    analysis = analyze(BAGS / "gap.mcap")
    assert [f.code for f in analysis.findings] == ["gap"]
    after = [v for v in analysis.verdicts if 2.3 < analysis.seconds(v.window_end_ns) < 2.45]
    assert {v.state for v in after} == {ChatterKind.UNKNOWN}
    assert summary(analysis)["missing_samples"] == 3840


def test_truncated_recording_names_the_way_out() -> None:
    with pytest.raises(InputError, match=r"truncated\.mcap.*turnmill recover"):
        analyze(BAGS / "truncated.mcap")


def test_iso_time_keeps_nanoseconds() -> None:
    assert iso_time(1_700_000_000_000_000_001) == "2023-11-14T22:13:20.000000001Z"


@pytest.mark.parametrize(("name", "speed", "chatter"), [
    ("chatter_1656rpm_6teeth", "1656 rpm", True), ("idle", "1656 rpm", False), ("stable_5955rpm", "5955 rpm", False),
])
def test_real_sound(name: str, speed: str, chatter: bool, tmp_path: Path, recordings: Path) -> None:
    from turnmill_ros.importers import import_sound
    from turnmill_ros.operations import find_operation

    bag = tmp_path / "cut.mcap"
    operation = find_operation("face_mill_6_teeth", [f"cut.tool_speed={speed}"])
    import_sound(recordings / "sound" / f"{name}.wav", operation, bag)
    found = summary(analyze(bag))
    if chatter:
        assert found["chatter_share_of_cut"] > 0.9
        assert found["chatter_frequency_hz"] == pytest.approx(899.0, abs=2.0)
    else:
        assert found["chatter_s"] == 0
        assert found["durations_s"]["FLIP_OR_RUNOUT"] == 0
