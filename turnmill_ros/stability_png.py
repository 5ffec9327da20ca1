"""Stability pictures as PNG by matplotlib: the diagram at one workpiece speed, or the limit over both speeds in 3D."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from turnmill_core.prediction import PredictedType
from turnmill_core.stability.lobes import Boundary, Lobes
from turnmill_core.stability.low_speed import LowSpeed
from turnmill_ros.stability_figures import EDGE_COLOURS, TYPE_COLOURS, TYPE_NAMES, trial_groups
from turnmill_ros.stability_values import RPM, Diagrams, limit_surface, low_speed_curves

MARKERS = {"stable": "o", "marginal": "^", "chatter": "x"}
ENDS = {PredictedType.HOPF: "o", PredictedType.FLIP: "s"}


def diagrams_png(found: Diagrams) -> bytes:
    """The picture: one diagram, the limits at low speed where they were asked for, or with several workpiece speeds the
    surface of limits and its view from above."""
    picture = Figure(figsize=(10, 6) if len(found.parts) == 1 else (15, 6.5), dpi=120, layout="constrained")
    if found.low_speed is not None:
        _low_speed(picture.add_subplot(), found, found.low_speed)
    elif len(found.parts) == 1:
        _diagram(picture.add_subplot(), found, found.parts[0])
    else:
        _surface(picture.add_subplot(1, 2, 1, projection="3d"), found)
        _from_above(picture, found)
        picture.suptitle(f"{found.op.name}: lowest depth limit over both spindles", fontsize=12)
    return png(picture)


def png(picture: Figure) -> bytes:
    """Bytes of the file, the same for the same picture."""
    out = io.BytesIO()
    picture.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def _diagram(axes: Any, found: Diagrams, part: Lobes | Boundary) -> None:
    rpm, handles = part.tool_speeds * RPM, []
    if isinstance(part, Lobes):
        kinds = list(TYPE_COLOURS)
        number = np.searchsorted([k.value for k in kinds], part.predicted_type)
        axes.set_facecolor(TYPE_COLOURS[PredictedType.STABLE])
        axes.pcolormesh(rpm, part.depths * 1e3, number, shading="nearest", cmap=ListedColormap(list(
            TYPE_COLOURS.values())), norm=BoundaryNorm(np.arange(len(kinds) + 1) - 0.5, len(kinds)), rasterized=True)
        handles += [Patch(facecolor=TYPE_COLOURS[kinds[k]], edgecolor="#444444", label=TYPE_NAMES[kinds[k]])
                    for k in np.unique(number)]
        handles += axes.plot(rpm, part.depth_limit * 1e3, color="black", label="lowest limit")
    else:
        handles += _boundary(axes, part, rpm)
    handles += _marks(axes, found, part.workpiece_speed)
    axes.set(xlabel="tool speed [rpm]", ylabel="axial depth of cut [mm]", ylim=(0, found.deepest * 1e3),
             title=found.op.name + (f"\nworkpiece {part.workpiece_speed * RPM:.4g} rpm"
                                    if found.op.process == "turn-milling" else ""))
    axes.margins(x=0)
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def _marks(axes: Any, found: Diagrams, workpiece_speed: float) -> list[Any]:
    handles = []
    if found.cut_at(workpiece_speed):
        handles += axes.plot([found.cut.tool_speed * RPM], [found.cut.depth * 1e3], "*", markersize=15,
                             markerfacecolor="white", markeredgecolor="black", label="operating point")
    for (outcome, agrees), group in sorted(trial_groups(found.trials_at(workpiece_speed)).items()):
        handles += axes.plot(
            [t.trial.tool_speed * RPM for t in group], [t.trial.depth * 1e3 for t in group], MARKERS[outcome],
            markersize=11, markeredgewidth=2.5, markeredgecolor="black" if agrees else "#0072b2",
            markerfacecolor="white", label=f"trial: {outcome}, {'computed too' if agrees else 'not so computed'}")
    return handles


def _low_speed(axes: Any, found: Diagrams, low: LowSpeed) -> None:
    handles = []
    for k, (name, limit) in enumerate(low_speed_curves(found, low).items()):
        handles += axes.plot(low.tool_speeds * RPM, limit, ("-", "--", "-.")[k],
                             color=("black", "#cc79a7", "#d55e00")[k], linewidth=2, label=name)
    handles += _marks(axes, found, found.parts[0].workpiece_speed)
    axes.set(xlabel="tool speed [rpm]", ylabel="axial depth of cut [mm]", ylim=(0, found.deepest * 1e3),
             title=f"{found.op.name}\nlowest limit at low speed")
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)


def _boundary(axes: Any, part: Boundary, rpm: np.ndarray[Any, Any]) -> list[Any]:
    axes.set_facecolor("#f3f3f3")
    width = (rpm[-1] - rpm[0]) / max(rpm.size - 1, 1)
    for speed, stable in zip(rpm, part.stable, strict=True):
        low, high = stable.intervals.T * 1e3
        axes.bar(np.full(low.size, speed), high - low, width, bottom=low, color=TYPE_COLOURS[PredictedType.STABLE])
    handles: list[Any] = [Patch(facecolor=TYPE_COLOURS[PredictedType.STABLE], edgecolor="#444444", label="stable")]
    for kind, marker in ENDS.items():
        points = [(speed, depth * 1e3) for speed, stable in zip(rpm, part.stable, strict=True)
                  for depth, there in zip(stable.intervals.ravel(), stable.types.ravel(), strict=True) if there == kind]
        if points:
            handles += axes.plot(*np.array(points).T, marker, markersize=3, color=EDGE_COLOURS[kind],
                                 label=f"limit, {TYPE_NAMES[kind]} beyond")
    return handles


def _surface(axes: Any, found: Diagrams) -> None:
    rpm = found.parts[0].tool_speeds * RPM
    rows = np.array([part.workpiece_speed for part in found.parts]) * RPM
    axes.plot_surface(*np.meshgrid(rpm, rows), limit_surface(found) * 1e3, cmap="cividis", rcount=200, ccount=400,
                      linewidth=0, antialiased=False)
    axes.set(xlabel="tool speed [rpm]", ylabel="workpiece speed [rpm]", zlabel="depth limit [mm]")
    axes.set_zlim(0, found.deepest * 1e3)
    axes.view_init(elev=35, azim=-60)


def _from_above(picture: Figure, found: Diagrams) -> None:
    rpm = found.parts[0].tool_speeds * RPM
    rows = np.array([part.workpiece_speed for part in found.parts]) * RPM
    axes = picture.add_subplot(1, 2, 2)
    drawn = axes.pcolormesh(rpm, rows, limit_surface(found) * 1e3, shading="nearest", cmap="cividis")
    picture.colorbar(drawn, label="depth limit [mm]")
    if rows[0] <= found.cut.workpiece_speed * RPM <= rows[-1]:
        axes.plot([found.cut.tool_speed * RPM], [found.cut.workpiece_speed * RPM], "*", markersize=15,
                  markerfacecolor="white", markeredgecolor="black", label="operating point")
        axes.legend(loc="upper right")
    axes.set(xlabel="tool speed [rpm]", ylabel="workpiece speed [rpm]")
