"""The command plan: the most productive cut within the limits of machine, tool and part."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    progress,
    quantity,
    table,
    values,
    whole,
)
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Operation
    from turnmill_core.process.plan import Choice, Grid, Plan

RPM = 60 / (2 * math.pi)
HELP = "Values as A,B,... or FROM..TO:COUNT, each with its unit"


def plan(
    op_name: OperationArgument,
    workpiece_speeds: Annotated[str | None, typer.Option(metavar="RANGE", help=f"{HELP}: 10rpm..50rpm:5.")] = None,
    tool_speeds: Annotated[str | None, typer.Option(metavar="RANGE", help="e.g. 1000rpm..12000rpm:200.")] = None,
    depths: Annotated[str | None, typer.Option(metavar="RANGE", help="e.g. 0.1mm..6mm:60.")] = None,
    feeds: Annotated[str | None, typer.Option(
        metavar="RANGE", help="Axial feeds (milling: per tooth), e.g. 6mm/rev,8mm/rev.")] = None,
    samples: Annotated[int, typer.Option(help="Draws of modes and coefficients for a robust choice; 0: none.")] = 40,
    share: Annotated[str, typer.Option(help="Share of the draws that must stay feasible.")] = "90%",
    seed: Annotated[int, typer.Option(help="Seed of the draws.")] = 0,
    write: Annotated[Path | None, typer.Option(
        "--write", metavar="YAML", help="Write the chosen cut as an operation file.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """The most productive cut within all limits: speeds, depth and feed; which limit binds where. Ctrl-C ends it.

    Example: turnmill plan thesis_table_5_1 --workpiece-speeds 10rpm..60rpm:6 --report plan.html --write best.yaml
    """
    from turnmill_core.process.plan import plan as make_plan
    from turnmill_core.process.robust import draw, feasible_share, robust_choice
    from turnmill_ros.operations import find_operation

    op = find_operation(op_name, changes or ())
    grid = _grid(op, tool_speeds, workpiece_speeds, depths, feeds)
    count, wanted = whole(samples, "--samples", 0, 1000), quantity(share, "%", "--share")
    assert wanted is not None
    if not 0 < wanted <= 1:
        raise InputError("--share", value=share, expected="more than 0 % and at most 100 %")
    for path in (write, report):
        if path is not None:
            new_file(path)
    robust, shares = None, [math.nan] * (len(grid.feeds) * len(grid.workpiece_speeds))
    with progress("planning", quiet=as_json) as advance:
        made = make_plan(op, grid, lambda done, _: advance(done * (0.6 if count else 1.0)))
        if count:
            draws = draw(op, count, whole(seed, "--seed", 0))
            shares = [math.nan if c is None else feasible_share(c, draws) for c in made.choices]
            advance(0.7)
            robust = robust_choice(made, draws, wanted, lambda done, _: advance(0.7 + 0.3 * done))
    chosen = robust or (made.best if not count else None)
    if report is not None:
        from turnmill_ros.plan_report import plan_report

        plan_report(report, made, shares, chosen, wanted if count else None)
    written = _write(write, op, chosen, count, seed)
    if as_json:
        print_json(_document(made, shares, robust, chosen, wanted, count, seed, written))
    else:
        _show(made, shares, chosen, count, wanted)
        for name, path in (("operation", written), ("report", report)):
            if path is not None:
                console.print(f"{name}: {path}", soft_wrap=True)
    if made.best is None:
        raise InputError(f"no cut of {op.name} meets all limits: {'; '.join(_why(made)[:3])}")
    if write is not None and written is None:
        raise InputError(f"nothing written: no cut stays feasible in {wanted:.0%} of {count} draws")


def _grid(op: Operation, tool: str | None, workpiece: str | None, depths: str | None, feeds: str | None) -> Grid:
    from dataclasses import replace

    from turnmill_core.process.plan import default_grid

    given = {
        "tool_speeds": _values(tool, "rad/s", "--tool-speeds"),
        "workpiece_speeds": _values(workpiece, "rad/s", "--workpiece-speeds"),
        "depths": _values(depths, "m", "--depths"),
        "feeds": _values(feeds, "m" if op.process == "milling" else "m/rev", "--feeds"),
    }
    if op.process == "milling" and workpiece is not None:
        raise InputError("--workpiece-speeds goes with turn-milling")
    return replace(default_grid(op), **{k: v for k, v in given.items() if v is not None})


def _values(text: str | None, unit: str, option: str) -> tuple[float, ...] | None:
    return None if text is None else tuple(values(text, unit, option))


def _write(path: Path | None, op: Operation, chosen: Choice | None, samples: int, seed: int) -> Path | None:
    if path is None or chosen is None:
        return None
    from turnmill_ros.plan_text import planned_text
    from turnmill_ros.report import write_text

    how = f"feasible in {chosen.share:.0%} of {samples} draws, seed {seed}" if samples else "most productive"
    note = f"Cut chosen by turnmill plan, from the operation {op.sha256[:12]}: {how}."
    write_text(path, planned_text(op, chosen, note))
    return path


def _why(made: Plan) -> list[str]:
    """Why each region without a cut has none."""
    from turnmill_ros.plan_text import conflict_text

    return [f"{_speed(r.workpiece_speed)}: {conflict_text(c[0])}"
            for r, choice, c in zip(made.regions, made.choices, made.reasons, strict=True) if choice is None and c]


def _speed(workpiece_speed: float) -> str:
    return f"workpiece {abs(workpiece_speed) * RPM:.4g} rpm" if workpiece_speed else "milling"


def _show(made: Plan, shares: list[float], chosen: Choice | None, samples: int, wanted: float) -> None:
    from turnmill_core.operation_limits import NO_LIMITS
    from turnmill_ros.plan_text import margin_text

    rows = []
    feeds = len({r.feed for r in made.regions}) > 1
    for found, choice, share in zip(made.regions, made.choices, shares, strict=True):
        first = [f"{abs(found.workpiece_speed) * RPM:.4g}", *[f"{found.feed * 1e3:.4g}"] * feeds]
        if choice is None:
            rows.append((*first, *["-"] * 6))
            continue
        low, high = (found.tool_speeds[k] * RPM for k in np.flatnonzero(found.feasible.any(axis=0))[[0, -1]])
        cut, binding = choice.conditions, choice.binding
        rows.append((
            *first, f"{low:.0f}-{high:.0f}", f"{cut.tool_speed * RPM:.0f}", f"{cut.depth * 1e3:.2f}",
            f"{choice.rate * 6e10:.0f}", "-" if binding is None else binding.name,
            "-" if math.isnan(share) else f"{share:.0%}"))
    table(f"{made.op.name}: most productive cut within all limits", (
        "workpiece rpm", *["feed mm"] * feeds, "feasible rpm", "tool rpm", "depth mm", "mm3/min", "binding limit",
        "draws"), rows)
    if made.op.limits == NO_LIMITS:
        console.print("the operation has no limits section: only stability and the flute length bound the cut")
    for line in _why(made):
        console.print(f"no cut at {line}", soft_wrap=True)
    if chosen is None:
        if made.best is not None:
            console.print(f"no cut stays feasible in {wanted:.0%} of {samples} draws")
        return
    cut = chosen.conditions
    how = f", feasible in {chosen.share:.0%} of {samples} draws" if samples else ""
    table(f"Chosen cut{how}", ("quantity", "value"), [
        ("tool speed", f"{cut.tool_speed * RPM:.0f} rpm"), ("workpiece speed", f"{cut.workpiece_speed * RPM:.6g} rpm"),
        ("depth", f"{cut.depth * 1e3:.3f} mm"), ("material removal rate", f"{chosen.rate * 6e10:.0f} mm3/min"),
        ("tool speeds that allow this depth", ", ".join(
            f"{a * RPM:.0f} to {b * RPM:.0f}" for a, b in chosen.tool_speeds) + " rpm")])
    for margin in sorted(chosen.margins, key=lambda m: float(m.margin)):
        console.print(f"  {margin_text(margin)}", soft_wrap=True)


def _choice_json(choice: Choice | None, share: float = math.nan) -> dict[str, Any] | None:
    if choice is None:
        return None
    cut, binding = choice.conditions, choice.binding
    return {
        "tool_speed_rad_s": cut.tool_speed, "workpiece_speed_rad_s": cut.workpiece_speed, "depth_m": cut.depth,
        "feed_m": choice.op.axial_feed or choice.op.feed_per_tooth, "material_removal_rate_m3_s": choice.rate,
        "form_error_m": choice.form_error, "share_feasible": choice.share if math.isnan(share) else share,
        "tool_speed_intervals_rad_s": choice.tool_speeds, "binding": binding and binding.name,
        "limits": [{"name": m.name, "unit": m.unit, "value": float(m.value), "bound": float(m.bound),
                    "margin": float(m.margin)} for m in choice.margins],
    }


def _document(
    made: Plan, shares: list[float], robust: Choice | None, chosen: Choice | None, wanted: float, samples: int,
    seed: int, written: Path | None,
) -> dict[str, Any]:
    from turnmill_ros.plan_text import conflict_text

    regions = []
    for found, choice, reasons, share in zip(made.regions, made.choices, made.reasons, shares, strict=True):
        usable = found.tool_speeds[found.feasible.any(axis=0)]
        regions.append({
            "workpiece_speed_rad_s": found.workpiece_speed, "feed_m": found.feed,
            "tool_speed_min_rad_s": usable[0] if usable.size else None,
            "tool_speed_max_rad_s": usable[-1] if usable.size else None, "best": _choice_json(choice, share),
            "conflicts": [{
                "limits": c.limits, "margins": c.margins, "asks_rad_s": c.asks, "allows_rad_s": c.allows,
                "text": conflict_text(c)} for c in reasons],
        })
    return {
        "operation": made.op.name, "operation_sha256": made.op.sha256, "samples": samples, "seed": seed,
        "share_wanted": wanted, "regions": regions, "best": _choice_json(made.best), "robust": _choice_json(robust),
        "chosen": _choice_json(chosen), "written": written and str(written),
        "pareto": [{
            "tool_speed_rad_s": t.tool_speed, "workpiece_speed_rad_s": t.workpiece_speed, "depth_m": t.depth,
            "feed_m": t.feed, "material_removal_rate_m3_s": t.rate, "form_error_m": t.form_error}
            for t in made.pareto],
    }
