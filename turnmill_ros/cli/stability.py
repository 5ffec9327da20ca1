"""The command stability: verdict and margin of one cut."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
import typer

from turnmill_ros.cli.cut_options import RPM, Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import JsonFlag, OperationArgument, SetOption, print_json, progress, table, whole

Delay = Literal["mean", "milling", "first-principles"]
DelayOption = Annotated[Delay, typer.Option(
    "--delay", help="Model of the regeneration delay; turnmill delay shows them all.")]


def stability(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None, delay: DelayOption = "mean",
    samples: Annotated[int, typer.Option(
        "--samples", metavar="N", help="Also the limit's uncertainty from N draws of modes and coefficients.")] = 0,
    seed: Annotated[int, typer.Option(help="Seed of the draws.")] = 0,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Is this cut stable, by how much, and of what kind would the chatter be.

    Example: turnmill stability thesis_table_4_9 --tool-speed 3350rpm --workpiece-speed 6rpm --depth 1.2mm
    """
    from turnmill_core.stability.margin import stability_margin
    from turnmill_core.stability.uncertainty import LimitDistribution, limit_distribution

    whole(samples, "--samples", 0, 10_000)
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    margin = stability_margin(op, cut, delay_model=delay)
    drawn: LimitDistribution | None = None
    if samples:
        with progress("drawing", quiet=as_json) as tell:
            drawn = limit_distribution(op, cut, samples=samples, seed=whole(seed, "--seed", 0), delay_model=delay,
                                       progress=lambda done, total: tell(done / total))
    kind = margin.predicted_type.name
    if as_json:
        print_json({
            "operation": op.name, "operation_sha256": op.sha256, "predicted_type": kind, "delay_model": delay,
            "tool_speed_rad_s": cut.tool_speed, "workpiece_speed_rad_s": cut.workpiece_speed, "depth_m": cut.depth,
            "spectral_radius": margin.spectral_radius, "depth_limit_m": margin.depth_limit,
            "stable_depths_m": margin.stable_depths, "depth_searched_m": margin.depth_searched,
            "depth_ratio": margin.depth_ratio, "chatter_frequency_hz": margin.chatter_frequency,
            "limit_type": margin.limit_type.name, "limit_frequency_hz": margin.limit_frequency,
            "multipliers": [[m.real, m.imag] for m in np.atleast_1d(margin.multipliers).tolist()],
            "principal_period_s": margin.principal_period, "delay_s": margin.delay,
            "nearest_stable_speed_rad_s": margin.nearest_stable_speed,
            "limit_samples_m": None if drawn is None else drawn.limits,
            "probability_stable": None if drawn is None else drawn.probability_stable,
        })
        return
    islands = ", ".join(f"{low * 1e3:.3f} to {high * 1e3:.3f}" for low, high in margin.stable_depths)
    at_least = "at least " if margin.depth_limit >= margin.depth_searched else ""
    rows = [
        ("verdict", kind),
        ("largest |Floquet multiplier|", f"{margin.spectral_radius:.5f}"),
        ("depth limit", f"{at_least}{margin.depth_limit * 1e3:.3f} mm"),
        ("stable depths", f"{islands or 'none'} mm"),
        ("depth / limit", f"{margin.depth_ratio:.3f}"),
        ("chatter frequency", _hertz(margin.chatter_frequency)),
        ("chatter at the limit", "-" if math.isnan(margin.limit_frequency) else
         f"{margin.limit_type.name}, {_hertz(margin.limit_frequency)}"),
        ("regeneration delay", f"{margin.delay * 1e3:.4f} ms"),
        ("nearest stable tool speed at this depth",
         "none found" if math.isnan(margin.nearest_stable_speed) else f"{margin.nearest_stable_speed * RPM:.0f} rpm"),
    ]
    if drawn is not None:
        low, middle, high = (f"{drawn.quantile(q) * 1e3:.3f}" for q in (0.05, 0.5, 0.95))
        rows += [(f"depth limit of {samples} draws (5 %, median, 95 %)", f"{low}, {middle}, {high} mm"),
                 ("share of the draws that is stable here", f"{drawn.probability_stable:.2f}")]
    table(title(op, cut), ("quantity", "value"), rows)


def _hertz(frequency: float) -> str:
    return "-" if math.isnan(frequency) else f"{frequency:.1f} Hz"
