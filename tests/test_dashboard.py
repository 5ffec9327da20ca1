"""The live page: what it keeps and draws, and that a browser shows it and keeps up."""

from __future__ import annotations

import math
import socket
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.browser import look
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.verdict import ChatterKind, Reason, Verdict
from turnmill_core.operation_sensors import Sensor, Sensors
from turnmill_ros.dashboard import SHOWN_S, SPECTRUM_S, LiveData, live_figures, serve

SECOND = 1_000_000_000


def verdict(time_s: float, state: ChatterKind = ChatterKind.STABLE, frequency: float = math.nan) -> Verdict:
    end = round(time_s * SECOND)
    family = () if math.isnan(frequency) else (frequency,)
    return Verdict(end - SECOND // 4, end, 0, "daq", 1, "mic", state, Reason.SYNCHRONOUS, "because <of this>",
                   frequency, family, 100.0, 316.0, asynchronous_ratio=0.01, half_order_ratio=1e-3)


def block(number: int, frequency: float = 778.0, stream: int = 1) -> SensorBlock:
    time = (number * 1024 + np.arange(1024)) / 51200
    samples = np.sin(2 * np.pi * frequency * time).astype(np.float32)[:, None]
    return SensorBlock(number * SECOND // 50, "daq", stream, number * 1024, 51200.0,
                       (Channel("mic", "sound_pressure", "Pa", "door"),), samples)


def filled() -> LiveData:
    data = LiveData("Demo operation", 0.1, 0.05)
    for k in range(200):
        data.verdict(verdict(k * 0.05, *((ChatterKind.HOPF, 778.3) if 80 < k < 120 else (ChatterKind.STABLE,))))
        data.margin({"stamp_ns": k * SECOND // 20, "depth": 2e-3, "depth_limit": 4e-3})
        data.load({"stamp_ns": k * SECOND // 20, "force_tool_mean": np.array([3.0, 4.0, 0.0]), "tool_torque_mean": 0.2})
    for k in range(60):
        data.block(block(k))
    return data


def test_old_values_go_and_a_new_run_starts_afresh() -> None:
    data = LiveData()
    for k in range(int(SHOWN_S) + 20):
        data.verdict(verdict(k))
    assert data.verdicts[-1].window_end_ns - data.verdicts[0].window_end_ns <= SHOWN_S * SECOND
    data.verdict(verdict(1.0))
    assert len(data.verdicts) == 1
    for k in range(100):
        data.block(block(k))
    assert len(data.blocks) * 0.02 <= SPECTRUM_S + 0.05
    data.block(block(0, stream=2))
    assert len(data.blocks) == 1


def test_the_page_holds_the_reports_figures_and_the_headline() -> None:
    data = filled()
    data.suggestion = ("tool 2901 rpm, 4 mm", "measured: chatter at 778.3 Hz")
    head, shown = live_figures(data)
    assert [f.title.text for f in shown] == [
        "Verdict", "What the verdict stands on", "Depth of cut and its predicted limit",
        "Predicted mean force on the tool", "Predicted mean torque on the tool spindle", "mic, last 0.5 s"]
    for words in ("Demo operation", "STABLE", "because &lt;of this&gt;", "50 % left", "tool 2901 rpm"):
        assert words in head
    frequency, amplitude = (np.asarray(shown[-1].renderers[0].data_source.data[k]) for k in ("f", "a"))
    assert frequency[np.argmax(amplitude)] == pytest.approx(778.0, abs=2.0)
    assert live_figures(LiveData())[1] == []


def test_volts_are_shown_calibrated_and_the_tip_by_its_first_probe() -> None:
    data = filled()
    probe = Sensor("low_x", "fibre probe", 5800.0, -1.0, 1.0)
    data.sensors = Sensors((Sensor("mic", "microphone", 0.05, -5.0, 5.0), probe))
    data.blocks.clear()
    for k in range(60):
        volts = replace(block(k), channels=(Channel("low_x", "voltage", "V"),))
        data.block(volts)
    data.verdict(replace(verdict(11.0), channel="tip_x"))
    _, shown = live_figures(data)
    assert shown[-1].title.text == "low_x, last 0.5 s"
    assert shown[-1].yaxis.axis_label == "amplitude [m]"
    assert max(shown[-1].renderers[0].data_source.data["a"]) == pytest.approx(1 / 5800, rel=0.2)


def test_a_browser_shows_the_page_and_keeps_up(tmp_path: Path) -> None:
    data = filled()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stop = serve(data, port)
    try:
        with pytest.raises(OSError, match="in use"):
            serve(data, port)
        later = threading.Timer(1.5, lambda: data.verdict(verdict(10.05, ChatterKind.HOPF, 778.3)))
        later.start()
        # the title is set by the page's tick: state and number of ticks
        title = look(f"http://127.0.0.1:{port}/", "document.title.startsWith('HOPF') && Bokeh.documents.length == 1 && "
                     "Bokeh.documents[0].roots()[0].children.length == 7 && document.title", tmp_path / "profile")
        assert str(title).startswith("HOPF - turnmill live")
    finally:
        stop()
