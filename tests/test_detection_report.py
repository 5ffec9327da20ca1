"""Tables, JSON and page of the detection benchmark, from hand-made signals."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.detection.test_bench import heard
from turnmill_core.detection.bench import QUICK, Tally, tally
from turnmill_core.detection.hearing import INDICATORS
from turnmill_core.detection.recordings import Episode
from turnmill_core.detection.rivals import RIVALS
from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_ros.cli.output import plain
from turnmill_ros.detection_report import behind, comparison_rows, detection_report, figures_json, summary_rows


@pytest.fixture
def found() -> Tally:
    """A chatter found by us alone, a ramp that no indicator finds, and a quiet signal with one false alarm of FFT."""
    true = Episode(ChatterKind.HOPF, 0.3, 0.5, 0.6)
    chatter = heard("SSSSSSHHHHHHHHHHHHHH", "SSSSSS" + 14 * "H", episode=true)
    noisy = np.zeros((20, len(INDICATORS)), dtype=np.float32)
    noisy[4:8, 1] = RIVALS[0].threshold
    quiet = replace(heard("S" * 20, "S" * 20), scores=noisy, ungated=noisy[:, 1:])
    return tally([chatter, quiet, replace(chatter, kind="ramp")])


def test_comparison_has_a_column_for_each_indicator(found: Tally) -> None:
    header, rows = comparison_rows(found)
    assert header == ("", *INDICATORS)
    table = {row[0]: row[1:] for row in rows}
    assert table["false alarms"] == ("0", "1", "0", "0", "0")
    assert table["Hopf found in time"][:2] == ("100.0 % of 1", "0.0 % of 1")
    assert table["ramps: median delay"][:2] == ("0.050 s", "none in time")
    assert "published" in table["threshold"][3]
    assert any("alarm on depth ramps" in what for what, _, _ in summary_rows(found))


def test_indicators_with_fewer_false_alarms_are_named_with_their_recalls(found: Tally) -> None:
    assert behind(found) == []
    better = np.array([[2.0, 1.0, 3.0, math.nan, 2.0], [2.0, 1.0, 3.0, math.nan, 2.0], [math.nan, 5.0, 1.0, 1.0, 9.0]])
    other = replace(found, recalls=np.array([0.2, 0.6, 1.0]), false_at=better)
    assert behind(other) == [
        "FFT energy ratio at recalls 0.20 to 1.00", "once-per-revolution variance at recalls 1.00 to 1.00",
        "Kalman comb, Teager-Kaiser at recalls 1.00 to 1.00", "maximum entropy, sequential at recalls 1.00 to 1.00"]


def test_json_has_no_value_that_json_does_not_know(found: Tally) -> None:
    text = json.dumps(plain(figures_json(QUICK, found)), allow_nan=False)
    read = json.loads(text)
    assert read["indicators"]["FFT energy ratio"]["ramp_delay_median_s"] is None
    assert read["indicators"]["turnmill"]["hopf"] == {"right": 1, "of": 1}
    assert read["fewer_false_alarms_than_ours"] == []


def test_page_is_written_with_all_indicators(found: Tally, tmp_path: Path) -> None:
    page = tmp_path / "hearing.html"
    detection_report(page, QUICK, found)
    text = page.read_text()
    assert all(name in text for name in INDICATORS)
    assert "none, at any recall" in text
