"""The finished surface as PNG in three dimensions, by matplotlib: all of the map, and a few tooth passes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from turnmill_core.process.surface_map import SurfaceMap
from turnmill_ros.stability_png import png
from turnmill_ros.surface_values import Surface

MOST = 180


def surface_png(found: Surface) -> bytes:
    """The picture: the unrolled map and a few tooth passes, heights above the programmed radius."""
    picture = Figure(figsize=(15, 6.5), dpi=120, layout="constrained")
    _relief(picture, 1, found.map, "unrolled surface")
    _relief(picture, 2, found.detail, "a few tooth passes")
    picture.suptitle(f"{found.op.name}: height above the programmed radius", fontsize=12)
    return png(picture)


def _relief(picture: Figure, place: int, found: SurfaceMap, title: str) -> None:
    axes: Any = picture.add_subplot(1, 2, place, projection="3d")
    rows, columns = (slice(None, None, math.ceil(size / MOST)) for size in found.height.shape)
    height = found.height[rows, columns] * 1e6
    x, y = np.meshgrid(np.degrees(found.angle[columns]), found.axial[rows] * 1e3)
    drawn = axes.plot_surface(x, y, height, cmap="cividis", linewidth=0, antialiased=False, rcount=MOST, ccount=MOST)
    axes.set_title(title)
    axes.set_xlabel("around [deg]")
    axes.set_ylabel("along the bar, +y_T [mm]")
    axes.set_zlabel("height [\u00b5m]")
    picture.colorbar(drawn, ax=axes, shrink=0.6, pad=0.1, label="height [\u00b5m], < 0: overcut")
