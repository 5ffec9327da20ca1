"""Offline analysis of a bag: the monitor's verdicts, merged into segments; no ROS needed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation import Operation
from turnmill_ros.bag import Finding, check_bag
from turnmill_ros.errors import InputError
from turnmill_ros.monitor_feed import open_feed

CHATTER = (ChatterKind.HOPF, ChatterKind.FLIP)


@dataclass(frozen=True)
class Segment:
    """Consecutive verdicts with the same state: from the end of its first window to the end of the next state's first.

    A verdict stands from its window's last sample, when it could be given, until the next one, but not
    across a hole in the recording; the first segment starts with the recording.
    """

    start_ns: int
    end_ns: int
    state: ChatterKind
    chatter_frequency: float
    confidence: float
    verdicts: int


@dataclass(frozen=True)
class Analysis:
    """What one bag holds, and the verdicts on it; start_ns is the first sample's acquisition time."""

    path: Path
    operation: Operation
    config: ChatterConfig
    start_ns: int
    end_ns: int
    verdicts: tuple[Verdict, ...]
    segments: tuple[Segment, ...]
    counts: dict[str, int]
    findings: tuple[Finding, ...] = ()

    def seconds(self, stamp_ns: int) -> float:
        """Time since the start of the recording [s]."""
        return (stamp_ns - self.start_ns) * 1e-9


def trusted(path: Path, allowed: Sequence[str] = ()) -> tuple[Finding, ...]:
    """Warnings and notes on a recording; raises InputError at the first error, which leaves no verdict to trust.

    allowed: codes of errors that do not matter to the caller.
    """
    findings = check_bag(path)
    for finding in findings:
        if finding.severity == "error" and finding.code not in allowed:
            when = "" if finding.time_s is None else f" at {finding.time_s:.3f} s"
            raise InputError(f"{finding.text}{when}", file=path, key=finding.topic or None)
    return tuple(findings)


def analyze(
    path: Path, operation: Operation | None = None, progress: Callable[[float], None] | None = None
) -> Analysis:
    """Run the monitor over a bag; `operation` replaces the one in the bag.

    Raises InputError for a bag that cannot be trusted, naming file and reason.
    """
    feed = open_feed(path, operation)
    findings = trusted(path)
    verdicts: list[Verdict] = []
    for new, share in feed.verdicts():
        verdicts.extend(new)
        if progress is not None:
            progress(share)
    return Analysis(path, feed.operation, feed.config, feed.start_ns, feed.end_ns, tuple(verdicts), merge(verdicts),
                    feed.counts, findings)


def analysis_of(path: Path, verdicts: Sequence[Verdict]) -> Analysis:
    """The analysis that holds the verdicts of a run of the nodes, on the bag that was recorded with them."""
    feed = open_feed(path)
    return Analysis(path, feed.operation, feed.config, feed.start_ns, feed.end_ns, tuple(verdicts), merge(verdicts),
                    feed.counts)


def merge(verdicts: Iterable[Verdict]) -> tuple[Segment, ...]:
    """Merge consecutive verdicts of the same state and stream."""
    groups: list[list[Verdict]] = []
    for verdict in verdicts:
        last = groups[-1][-1] if groups else None
        if last is not None and (last.state, last.stream_id, last.device) == (verdict.state, verdict.stream_id,
                                                                              verdict.device):
            groups[-1].append(verdict)
        else:
            groups.append([verdict])
    ends = [v.window_end_ns for group in groups for v in group]
    hole = 2 * min((b - a for a, b in pairwise(ends) if b > a), default=0)
    segments = []
    for k, group in enumerate(groups):
        start = group[0].window_end_ns if k else group[0].window_start_ns
        end = group[-1].window_end_ns
        if k + 1 < len(groups) and groups[k + 1][0].window_end_ns - end <= hole:
            end = groups[k + 1][0].window_end_ns
        heard = [v.chatter_frequency for v in group if math.isfinite(v.chatter_frequency)]
        segments.append(Segment(start, end, group[0].state,
                                float(np.median(heard)) if heard else math.nan,
                                float(np.mean([v.confidence for v in group])), len(group)))
    return tuple(segments)


def summary(analysis: Analysis) -> dict[str, Any]:
    """Durations per state, share of the cut in chatter, and median chatter frequency."""
    length = {
        kind: sum((s.end_ns - s.start_ns) * 1e-9 for s in analysis.segments if s.state is kind) for kind in ChatterKind
    }
    in_cut = sum(v for k, v in length.items() if k not in (ChatterKind.UNKNOWN, ChatterKind.AIR))
    chatter = sum(length[k] for k in CHATTER)
    heard = [
        v.chatter_frequency for v in analysis.verdicts if v.state in CHATTER and math.isfinite(v.chatter_frequency)
    ]
    return {
        "duration_s": analysis.seconds(analysis.end_ns),
        "in_cut_s": in_cut,
        "chatter_s": chatter,
        "chatter_share_of_cut": chatter / in_cut if in_cut > 0 else math.nan,
        "chatter_frequency_hz": float(np.median(heard)) if heard else math.nan,
        "durations_s": {kind.name: length[kind] for kind in ChatterKind},
        "verdict_count": len(analysis.verdicts),
        **analysis.counts,
    }


def iso_time(stamp_ns: int) -> str:
    """UTC time with nanoseconds, ISO 8601."""
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def verdict_json(verdict: Verdict, start_ns: int) -> dict[str, Any]:
    """One verdict as JSON values; times in seconds from `start_ns`."""
    prior = verdict.prior
    return {
        "t_start_s": (verdict.window_start_ns - start_ns) * 1e-9,
        "t_end_s": (verdict.window_end_ns - start_ns) * 1e-9,
        "state": verdict.state.name,
        "reason": verdict.reason.name,
        "reason_text": verdict.reason_text,
        "chatter_frequency_hz": verdict.chatter_frequency,
        "chatter_family_hz": list(verdict.chatter_family),
        "tooth_passing_frequency_hz": verdict.tooth_passing_frequency,
        "spindle_speed_rad_s": verdict.spindle_speed,
        "spindle_speed_source": verdict.spindle_speed_source.name,
        "asynchronous_ratio": verdict.asynchronous_ratio,
        "half_order_ratio": verdict.half_order_ratio,
        "level": verdict.level,
        "confidence": verdict.confidence,
        "device": verdict.device,
        "stream_id": verdict.stream_id,
        "channel": verdict.channel,
        "last_sample": verdict.last_sample,
        "prior": None if prior is None else {
            "t_s": (prior.stamp_ns - start_ns) * 1e-9,
            "predicted_type": prior.predicted_type.name,
            "spectral_radius": prior.spectral_radius,
            "chatter_frequency_hz": prior.chatter_frequency,
        },
    }


def analysis_json(analysis: Analysis) -> dict[str, Any]:
    """The whole analysis as JSON values: start_time, verdicts, segments, summary."""
    return {
        "bag": str(analysis.path),
        "start_time": iso_time(analysis.start_ns),
        "operation": {"name": analysis.operation.name, "sha256": analysis.operation.sha256},
        "findings": [
            {"severity": f.severity, "code": f.code, "topic": f.topic, "text": f.text, "t_s": f.time_s,
             "count": f.count}
            for f in analysis.findings
        ],
        "verdicts": [verdict_json(v, analysis.start_ns) for v in analysis.verdicts],
        "segments": [
            {"t_start_s": analysis.seconds(s.start_ns), "t_end_s": analysis.seconds(s.end_ns), "state": s.state.name,
             "chatter_frequency_hz": s.chatter_frequency, "confidence": s.confidence, "verdict_count": s.verdicts}
            for s in analysis.segments
        ],
        "summary": summary(analysis),
    }


def timeline(segments: Sequence[Segment], shortest_s: float = 0.3) -> tuple[Segment, ...]:
    """Segments without UNKNOWN and MARGINAL and without ones shorter than `shortest_s`, same states merged."""
    kept: list[Segment] = []
    for s in segments:
        if s.state in (ChatterKind.UNKNOWN, ChatterKind.MARGINAL) or (s.end_ns - s.start_ns) * 1e-9 < shortest_s:
            continue
        if kept and kept[-1].state is s.state:
            a = kept[-1]
            kept[-1] = Segment(
                a.start_ns, s.end_ns, s.state, a.chatter_frequency, a.confidence, a.verdicts + s.verdicts
            )
        else:
            kept.append(s)
    return tuple(kept)
