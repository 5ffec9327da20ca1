"""Predicted loads and stability margins found in a bag, thinned for pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bokeh.models import Range1d

from turnmill_ros import figures, topics
from turnmill_ros.bag import read_bag
from turnmill_ros.conversions import time_from_message

MAX_POINTS = 4000


@dataclass(frozen=True)
class Predictions:
    """Stamps [ns] with (resultant mean force [N], tool torque [N m]) and with (depth, depth limit [mm])."""

    loads: tuple[tuple[int, float, float], ...]
    margins: tuple[tuple[int, float, float], ...]

    def plots(self, start_ns: int, x_range: Range1d) -> list[Any]:
        """Figures over time; none where the bag holds no predictions."""
        made = []
        if self.margins:
            time = [(s - start_ns) * 1e-9 for s, _, _ in self.margins]
            made.append(figures.lines_over_time("Depth of cut and its predicted limit", "depth [mm]", time, {
                "depth": [d for _, d, _ in self.margins], "limit": [m for _, _, m in self.margins]}, x_range))
        if self.loads:
            time = [(s - start_ns) * 1e-9 for s, _, _ in self.loads]
            for what, unit, k in (("force on the tool", "N", 1), ("torque on the tool spindle", "N m", 2)):
                named = {f"mean {what.split()[0]}": [load[k] for load in self.loads]}
                made.append(figures.lines_over_time(f"Predicted mean {what}", f"{what.split()[0]} [{unit}]", time,
                                                    named, x_range))
        return made


def read_predictions(path: Path) -> Predictions:
    """Predictions in a bag; empty where it holds inputs only. Raises InputError for an unreadable bag."""
    loads: list[tuple[int, float, float]] = []
    margins: list[tuple[int, float, float]] = []
    for topic, _, message in read_bag(path, (topics.CUTTING_LOADS.name, topics.STABILITY_MARGIN.name)):
        stamp = time_from_message(message.header.stamp)
        if topic.endswith(topics.CUTTING_LOADS.name):
            f = message.force_tool_mean
            loads.append((stamp, (f.x**2 + f.y**2 + f.z**2) ** 0.5, message.tool_torque_mean))
        else:
            margins.append((stamp, max(message.depth, 0.0) * 1e3, message.depth_limit * 1e3))
    return Predictions(_thin(loads), _thin(margins))


def _thin(rows: list[tuple[int, float, float]]) -> tuple[tuple[int, float, float], ...]:
    return tuple(rows[:: max(1, -(-len(rows) // MAX_POINTS))])
