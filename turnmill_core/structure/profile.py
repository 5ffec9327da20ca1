"""The shape of a bar along its axis, as cylinders from the free end to the chuck."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.operation import Workpiece, require
from turnmill_core.structure.modal import Floats, frozen_array

TAPER_PARTS = 6
"""Cylinders that stand for one conical or curved interval of a stock profile."""


@dataclass(frozen=True, eq=False)
class BarProfile:
    """A bar as cylinders.

    edges (k+1,) [m]: distances from the free end, ascending from 0 to the chuck; radius (k,) [m]; bore [m]: radius of
    a hole along the axis.
    """

    edges: Floats
    radius: Floats
    bore: float = 0.0

    def __post_init__(self) -> None:
        radius = frozen_array(self.radius, "bar radius [m]", (-1,))
        edges = frozen_array(self.edges, "bar edges [m]", (radius.size + 1,))
        if radius.size == 0 or edges[0] != 0 or np.any(np.diff(edges) <= 0):
            raise ValueError(f"bar edges are {edges} m, expected ascending distances from 0 at the free end")
        require(0 <= self.bore < radius.min(), "bar radius", float(radius.min()), "m", f"above the bore {self.bore} m")
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "edges", edges)

    @property
    def length(self) -> float:
        """From the free end to the chuck [m]."""
        return float(self.edges[-1])

    def mass(self, density: float) -> float:
        """Mass [kg] for a density [kg/m3]."""
        return float(density * np.pi * np.diff(self.edges) @ (self.radius**2 - self.bore**2))

    def split(self, at: ArrayLike) -> BarProfile:
        """The same bar with further edges at distances `at` [m] from the free end.

        Left out are those outside it and those within a ten-thousandth of its length of another edge.
        """
        places = np.atleast_1d(np.asarray(at, dtype=np.float64))
        tiny = 1e-4 * self.length
        far = np.abs(places[:, None] - self.edges).min(axis=1) > tiny
        edges = np.unique(np.concatenate([self.edges, places[far & (places > 0) & (places < self.length)]]))
        middle = (edges[:-1] + edges[1:]) / 2
        return BarProfile(edges, self.radius[np.searchsorted(self.edges, middle) - 1], self.bore)

    def cut(self, start: float, end: float, radius: float) -> BarProfile:
        """What is left when everything outside `radius` [m] from `start` to `end` [m] (from the free end) is gone."""
        require(radius > self.bore, "radius of the cut", radius, "m", f"above the bore {self.bore} m")
        whole = self.split([start, end])
        middle = (whole.edges[:-1] + whole.edges[1:]) / 2
        inside = (middle > start) & (middle < end)
        return BarProfile(whole.edges, np.where(inside, np.minimum(whole.radius, radius), whole.radius), self.bore)

    def part(self, start: float, end: float) -> BarProfile:
        """The piece from `start` to `end` [m] (from the free end), as a bar of its own."""
        whole = self.split([start, end])
        keep = (whole.edges[:-1] >= start - 1e-9) & (whole.edges[1:] <= end + 1e-9)
        edges = np.append(whole.edges[:-1][keep], whole.edges[1:][keep][-1])
        return BarProfile(edges - edges[0], whole.radius[keep], self.bore)


def cylinder(length: float, diameter: float, bore: float = 0.0) -> BarProfile:
    """A cylinder of `length`, `diameter` and bore diameter `bore` [m]."""
    return BarProfile(np.array([0.0, length]), np.array([diameter / 2]), bore / 2)


def stock_profile(bar: Workpiece) -> BarProfile:
    """The bar before the cut; conical intervals of its profile as cylinders of the same volume."""
    bore = 0.0 if bar.beam is None else bar.beam.bore / 2
    if not bar.profile:
        return BarProfile(np.array([0.0, bar.length]), np.array([bar.radius]), bore)
    edges, radius = [0.0], []
    for (z0, r0), (z1, r1) in pairwise(bar.profile):
        if z0 - z1 <= 1e-9 * bar.length:
            continue
        parts = 1 if r0 == r1 else TAPER_PARTS
        border = np.linspace(r0, r1, parts + 1)
        radius += np.sqrt((border[:-1] ** 2 + border[:-1] * border[1:] + border[1:] ** 2) / 3).tolist()
        edges += (-np.linspace(z0, z1, parts + 1)[1:]).tolist()
    return BarProfile(np.array(edges), np.array(radius), bore)


def profile_of_heights(z: ArrayLike, radius: ArrayLike, bore: float = 0.0) -> BarProfile:
    """A bar from a map of its radius (k, n) [m] around the axis, at distances z (k,) [m] from the free end.

    Each interval between two z is a cylinder of the mean cross-section of its ends. bore [m]: radius of a hole.
    """
    around = np.asarray(radius, dtype=np.float64)
    square = np.mean(around.reshape(around.shape[0], -1) ** 2, axis=1)
    edges = np.asarray(z, dtype=np.float64)
    return BarProfile(edges - edges[0], np.sqrt((square[:-1] + square[1:]) / 2), bore)
