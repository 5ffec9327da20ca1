"""Tables, JSON and pictures of the detection benchmark."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource as Source
from bokeh.models import FactorRange, Label, LabelSet, Span
from bokeh.plotting import figure

from turnmill_core.detection.bench import Plan, Tally
from turnmill_core.detection.comparison import EARLY, LATE, Standing, runs
from turnmill_core.detection.cuts import KINDS, TRAIN_END
from turnmill_core.detection.hearing import INDICATORS
from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_ros import figures
from turnmill_ros.report import html_table, write_page


def _share(part: tuple[int, int]) -> str:
    return f"{100 * part[0] / part[1]:.1f} % of {part[1]}" if part[1] else "none asked"


def _of_three(part: tuple[int, int, int]) -> str:
    right, undecided, count = part
    return f"{_share((right, count))}, {100 * undecided / count:.1f} % undecided" if count else "none asked"


def summary_rows(found: Tally) -> list[tuple[str, str, str]]:
    """What, found, wanted."""
    delays = found.delays
    per_hour = f"{found.false_alarms / found.hours:.2f} per hour" if found.hours > 0 else "no such signal"
    return [
        ("false alarms", f"{found.false_alarms} in {found.hours:.2f} h ({per_hour})", "at most 1 per hour"),
        ("flip or runout, undecided, in the same hours", f"{found.undecided}", ""),
        (f"Hopf chatter found within {LATE:g} s of full amplitude", _share(found.hopf), "at least 95 %"),
        ("period two, odd teeth, found likewise", _share(found.flip_odd), "at least 90 %"),
        ("flip or runout, even teeth, prior of a wrong model", _share(found.half_order_prior), "at least 90 %"),
        ("flip, even teeth, without a prior: FLIP_OR_RUNOUT", _share(found.half_order), "at least 90 %"),
        ("flip or runout, even teeth, runout known to 20 %", _of_three(found.half_order_runout), ""),
        ("alarm on depth ramps after 20 %, median", _seconds(_median(delays)) if len(delays) else "none asked",
         f"at most {LATE:g} s"),
        ("alarm on depth ramps before tripled", _share((found.standings[0].before_tripled, len(delays))), "all"),
        ("verdicts that a tachometer 1 % wrong changes", _share(found.changed), "at most 1 %"),
        ("CPU time per second of signal", f"{found.standings[0].cpu:.3f} s", ""),
    ]


def comparison_rows(found: Tally) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: ours and published indicators side by side, each at its operating point."""
    what = ("threshold", "false alarms", "false alarms per hour", "false alarms without the gate",
            "share of quiet time in false alarms", "Hopf found in time", "period two, odd teeth, found in time",
            "area under the ROC curve", "ramps: median delay", "ramps: before tripled", "CPU time per second")
    columns = [_comparison_column(found, s) for s in found.standings]
    return ("", *(s.name for s in found.standings)), list(zip(what, *columns, strict=True))


def _comparison_column(found: Tally, s: Standing) -> tuple[str, ...]:
    threshold = s.source if math.isnan(s.threshold) else f"{s.threshold:.3g}, {s.source}"
    return (threshold, f"{s.false_alarms}", f"{s.false_alarms / found.hours:.1f}" if found.hours else "",
            f"{s.ungated}", f"{100 * s.false_share:.2g} %", _share(s.hopf), _share(s.flip_odd), f"{s.area:.4f}",
            _seconds(_median(s.delays)) if s.delays else "none asked",
            _share((s.before_tripled, len(s.delays))), f"{s.cpu:.4f} s")


def _seconds(value: float) -> str:
    return f"{value:.3f} s" if math.isfinite(value) else "none in time"


def _median(delays: Sequence[float]) -> float:
    """Median delay [s]; a ramp without an alarm counts as infinitely late."""
    found = np.array(delays)
    return float(np.median(np.where(np.isnan(found), np.inf, found))) if len(found) else math.nan


def behind(found: Tally) -> list[str]:
    """Indicators that somewhere have fewer false alarms than we do at the same recall, and where."""
    better = np.nan_to_num(found.false_at, nan=np.inf)
    where = []
    for k, name in enumerate(INDICATORS):
        first, last = runs(better[:, k] < better[:, 0])
        ranges = [f"{found.recalls[a]:.2f} to {found.recalls[b]:.2f}" for a, b in zip(first, last, strict=True)]
        if ranges:
            where.append(f"{name} at recalls {', '.join(ranges)}")
    return where


def confusion_rows(found: Tally) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of the confusion of windows."""
    kinds = [k for k in ChatterKind if found.confusion[k].any()]
    rows = [(k.name, *(str(int(n)) for n in found.confusion[k])) for k in kinds]
    return ("truly", *(k.name for k in ChatterKind)), rows


def figures_json(plan: Plan, found: Tally) -> dict[str, Any]:
    """The figures as JSON values."""
    return {
        "seeds": "training" if plan.first < TRAIN_END else "test", "cuts": dict(zip(KINDS, plan.cuts, strict=True)),
        "confusion": {t.name: {s.name: int(found.confusion[t, s]) for s in ChatterKind} for t in ChatterKind
                      if found.confusion[t].any()},
        "false_alarms": found.false_alarms, "quiet_hours": found.hours, "undecided": found.undecided,
        **{name: {"right": part[0], "of": part[1]} for name, part in (
            ("hopf", found.hopf), ("period_two_odd_teeth", found.flip_odd),
            ("half_order_with_prior", found.half_order_prior), ("half_order_without_prior", found.half_order),
            ("changed_by_tachometer", found.changed))},
        "half_order_with_known_runout": dict(zip(("right", "undecided", "of"), found.half_order_runout, strict=True)),
        "ramp_delays_s": list(found.delays), "ramp_tripled_s": list(found.tripled),
        "ramp_delay_median_s": _finite(_median(found.delays)),
        "indicators": {s.name: _standing_json(s) for s in found.standings},
        "recalls": found.recalls, "false_alarms_per_hour_at_recall": {
            name: found.false_at[:, k] for k, name in enumerate(INDICATORS)},
        "fewer_false_alarms_than_ours": behind(found), "missed": list(found.missed),
        "false_alarms_in": list(found.raised),
    }


def _standing_json(s: Standing) -> dict[str, Any]:
    return {
        "threshold": s.threshold, "threshold_source": s.source, "false_alarms": s.false_alarms,
        "false_alarms_without_gate": s.ungated, "share_of_time_in_false_alarms": s.false_share,
        "hopf": {"right": s.hopf[0], "of": s.hopf[1]},
        "period_two_odd_teeth": {"right": s.flip_odd[0], "of": s.flip_odd[1]}, "roc_area": s.area,
        "ramp_delay_median_s": _finite(_median(s.delays)), "ramps_before_tripled": s.before_tripled,
        "ramps": len(s.delays), "cpu_s_per_s": s.cpu,
    }


def _finite(value: float) -> float:
    """The value, NaN where it is infinite."""
    return value if math.isfinite(value) else math.nan


def detection_report(output: Path, plan: Plan, found: Tally) -> None:
    """Write the page with tables and pictures."""
    header, rows = confusion_rows(found)
    comparison = comparison_rows(found)
    seeds = "training" if plan.first < TRAIN_END else "test"
    write_page(output, "turnmill: detection", [
        "<h1>How well the monitor hears</h1>",
        f"<p class=note>{sum(plan.cuts)} simulated cuts and {plan.hours:g} h of signal without chatter, {seeds} "
        "seeds; labelled by the motion without noise.</p>",
        html_table(summary_rows(found), ("what", "found", "wanted")), "<h2>Windows</h2>", html_table(rows, header),
        "<h2>Beside published indicators</h2>",
        "<p class=note>All by the same rules: an alarm needs two windows in a row; found means an alarm of any "
        f"kind within {LATE:g} s of full amplitude; a false alarm begins more than {EARLY:g} s before "
        "anything that is not surely free of chatter. The indicators get the true rotation, and a gate: they are "
        "heard where the level is twice that of the air.</p>",
        html_table(comparison[1], comparison[0]),
        f"<p class=note>Fewer false alarms than ours: {'; '.join(behind(found)) or 'none, at any recall'}.</p>",
    ], [("Pictures", false_alarm_curves(found)), ("", confusion_picture(found)), ("", delays_picture(found))], [])


def false_alarm_curves(found: Tally) -> figure:
    """False alarms per hour over recall, one curve per indicator, and the operating point on or beside each."""
    plot = figures.new_figure("False alarms at each recall, by threshold; symbols: operating points",
                              "share of chatters found in time [1]", "false alarms per hour [1/h]", 420,
                              y_axis_type="log", x_range=(0, 1.02))
    none = 0.5 / max(found.hours, 1e-3)
    for k, s in enumerate(found.standings):
        style = {"color": figures.LINE_COLOURS[k], "legend_label": s.name}
        plot.step(found.recalls, np.maximum(found.false_at[:, k], none), line_width=2.5, mode="before",
                  line_dash=("solid", "dashed", "dotdash", "dotted", "dashdot")[k], **style)
        asked = s.hopf[1] + s.flip_odd[1]
        if asked:
            plot.scatter([(s.hopf[0] + s.flip_odd[0]) / asked], [max(none, s.false_alarms / max(found.hours, 1e-3))],
                         size=12, marker=("circle", "square", "triangle", "diamond", "inverted_triangle")[k],
                         line_color="#222222", **style)
    plot.add_layout(Span(location=none, dimension="width", line_color="#888888", line_dash="dotted"))
    plot.add_layout(Label(x=0.01, y=none, text="none at all", text_font_size="9pt", text_color="#666666",
                          y_offset=3))
    figures.legend_right(plot)
    return plot


def confusion_picture(found: Tally) -> figure:
    """Confusion as shares of each row."""
    kinds = [k for k in ChatterKind if found.confusion[k].any()]
    plot = figures.new_figure("What was said of each true state", "verdict", "true state", 300,
                              x_range=FactorRange(*[k.name for k in ChatterKind]),
                              y_range=FactorRange(*[k.name for k in reversed(kinds)]))
    cells = [(t, s, found.confusion[t, s] / found.confusion[t].sum()) for t in kinds for s in ChatterKind]
    source = Source({"x": [s.name for _, s, _ in cells], "y": [t.name for t, _, _ in cells],
                     "alpha": [float(v) ** 0.5 for _, _, v in cells],
                     "text": [f"{100 * v:.1f} %" if v else "" for _, _, v in cells]})
    plot.rect("x", "y", 0.96, 0.92, source=source, fill_color=figures.LINE_COLOURS[5], fill_alpha="alpha",
              line_color="#888888")
    plot.add_layout(LabelSet(x="x", y="y", text="text", source=source, text_align="center", text_baseline="middle",
                             text_font_size="10pt"))
    plot.grid.visible = False
    return plot


def delays_picture(found: Tally) -> figure:
    """Alarm of every depth ramp after the 20 % crossing beside the time in which the amplitude triples."""
    plot = figures.new_figure(f"Alarms on depth ramps (earlier than {LATE:g} s before the crossing: at the lower edge)",
                              "time from the crossing of 20 % to tripled amplitude [s]",
                              "alarm after the crossing [s]", 300, x_axis_type="log")
    tripled, delays = np.array(found.tripled), np.array(found.delays)
    at = np.isfinite(tripled) & np.isfinite(delays)
    plot.scatter(tripled[at], np.maximum(delays[at], -LATE), size=8, color=figures.LINE_COLOURS[0],
                 legend_label="alarm")
    highest = max(2 * LATE, 1.1 * float(delays[at].max(initial=0.0)))
    until = np.geomspace(min(0.03, float(tripled[at].min(initial=1.0))), highest, 60)
    plot.line(until, until, color="#444444", line_dash="dashed", legend_label="tripled")
    plot.line([until[0], float(tripled[at].max(initial=1.0))], [LATE, LATE], color="#444444", line_dash="dotted",
              legend_label=f"{LATE:g} s")
    figures.legend_right(plot)
    return plot
