"""Surface of a cut as the command tells it: form error, maps, roughness; JSON, CSV and PLY."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import machine_from_tool, with_cut
from turnmill_core.operation import Conditions, Operation
from turnmill_core.process.roughness import Roughness, profile_roughness, surface_roughness
from turnmill_core.process.surface import FormError, form_error, steady_axial
from turnmill_core.process.surface_map import SurfaceMap, ToothPrint, surface_map, tooth_print
from turnmill_core.process.surface_profile import surface_feed_per_tooth, surface_shift, wiper_overlap
from turnmill_core.stability.margin import stability_point
from turnmill_core.structure.at import plain_structures

Floats = NDArray[np.float64]
FACETS_SHOWN = 6
ZOOM = (240, 160)


@dataclass(frozen=True, eq=False)
class Surface:
    """Everything that the command tells of one cut.

    error: Eq. 5.6; map: the whole; detail: a few tooth passes; printed: one tooth in the thesis' reading; axial: tool
    angle [rad] and steady vibration along the tool axis [m]. along, around: roughness of a profile along the bar and
    around it, areal: of the map. feed, shift, overlap [m]: feed per tooth at the surface, what the surface moves
    between two teeth, and the length of the wiper that passes twice. warnings: what a reader must know first.
    """

    op: Operation
    cut: Conditions
    error: FormError
    map: SurfaceMap
    detail: SurfaceMap
    printed: ToothPrint
    axial: tuple[Floats, Floats]
    along: Roughness
    around: Roughness
    areal: Roughness
    feed: float
    shift: float
    overlap: float
    warnings: tuple[str, ...]


def surface(
    op: Operation, cut: Conditions, around: float | None, passes: float, columns: int | None, rows: int, cutoff: float,
    progress: Callable[[float], None] | None = None,
) -> Surface:
    """Compute everything; around to rows and progress: see surface_map; cutoff [m] of the profile filter."""
    axial = steady_axial(op, cut)
    whole = surface_map(op, cut, around, passes, columns, rows, axial, progress)
    facet = abs(cut.workpiece_speed) * 2 * math.pi / (op.tool.teeth * cut.tool_speed)
    detail = surface_map(op, cut, min(2 * math.pi, FACETS_SHOWN * facet), 1.0, *ZOOM, axial)
    period = 2 * math.pi / (op.tool.teeth * cut.tool_speed)
    shift = surface_shift(cut.effective_radius, cut.workpiece_speed, period)
    middle = whole.height.shape[0] // 2
    step = float(whole.axial[1] - whole.axial[0])
    arc = whole.radius * float(whole.angle[1] - whole.angle[0])
    return Surface(
        op, cut, form_error(op, cut), whole, detail, tooth_print(op, cut), axial,
        _profile(whole.height[:, 0], step, cutoff, passes == round(passes)),
        _profile(whole.height[middle], arc, cutoff, around is None),
        surface_roughness(whole.height), surface_feed_per_tooth(op, cut), shift,
        wiper_overlap(op.tool.shape.wiper_length, shift), _warnings(op, cut),
    )


def _warnings(op: Operation, cut: Conditions) -> tuple[str, ...]:
    """The surface is that of a steady cut: says where the cut chatters."""
    rotation = machine_from_tool(op, cut)
    if not any(structure.flexible for structure in plain_structures(op, rotation, cut)):
        return ()
    point = stability_point(op, cut)
    if point.spectral_radius < 1:
        return ()
    return (f"this cut chatters (|multiplier| {point.spectral_radius:.3f}); the surface shown is that of its steady "
            "vibration, which a machine would not show",)


def _profile(profile: Floats, spacing: float, cutoff: float, closed: bool) -> Roughness:
    """Roughness of a profile; without the filter where it does not repeat itself or is shorter than five cut-offs."""
    long = 2 * spacing < cutoff and profile.size * spacing >= 5 * cutoff
    return profile_roughness(profile, spacing, cutoff if long and closed else None)


def table_rows(found: Surface) -> list[tuple[str, str]]:
    """Table: quantity and value."""
    um = 1e6
    error, shape, printed = found.error, found.op.tool.shape, found.printed.height
    lines = [
        ("feed per tooth at the surface", f"{found.feed * 1e3:.4f} mm"),
        ("circularity, corner of the polygon (Eq. 4.130)", f"{error.circularity * um:.4f} um"),
        ("static cusp (Eq. 4.131)", f"{error.cusp * um:.3f} um"),
        ("vibration along the tool axis, undercut and overcut", f"{error.undercut * um:.3f} and "
                                                                f"{error.overcut * um:.3f} um"),
        ("form error (Eq. 5.6)", f"{error.total * um:.3f} um"),
        ("print of one tooth, undercut and overcut (Eq. 4.132)", f"{max(0.0, printed.max()) * um:.3f} and "
                                                                 f"{max(0.0, -printed.min()) * um:.3f} um"),
    ]
    if shape.wiper_length:
        lines.append(("wiper, overlap of two teeth (Eq. 4.134)",
                      f"{shape.wiper_length * 1e3:.4f} mm, {found.overlap * 1e3:.4f} mm"))
    whole = found.map
    lines += [
        ("finished surface, undercut and overcut", f"{whole.undercut * um:.3f} and {whole.overcut * um:.3f} um"),
        ("mean radius, above the programmed one", f"{whole.mean_radius * 1e3:.6f} mm, "
                                                  f"{(whole.mean_radius - whole.radius) * um:.3f} um"),
        ("Sa, Sq, Sz", ", ".join(f"{v * um:.3f}" for v in (found.areal.mean_deviation, found.areal.rms,
                                                           found.areal.height)) + " um"),
    ]
    for name, r in (("along the bar", found.along), ("around the bar", found.around)):
        lines.append((f"Ra, Rq, Rz {name}", ", ".join(f"{v * um:.3f}" for v in (r.mean_deviation, r.rms, r.height))
                      + " um"))
    return lines


def document(found: Surface) -> dict[str, object]:
    """JSON form, SI units."""
    def figures(r: Roughness) -> dict[str, float]:
        return {"mean_deviation_m": r.mean_deviation, "rms_m": r.rms, "height_m": r.height, "total_m": r.total,
                "skewness": r.skewness, "kurtosis": r.kurtosis}

    error, whole, printed = found.error, found.map, found.printed.height
    return {
        "operation": found.op.name, "operation_sha256": found.op.sha256, "tool_speed_rad_s": found.cut.tool_speed,
        "workpiece_speed_rad_s": found.cut.workpiece_speed, "depth_m": found.cut.depth,
        "feed_per_tooth_m": found.feed, "circularity_m": error.circularity, "cusp_m": error.cusp,
        "undercut_m": error.undercut, "overcut_m": error.overcut, "form_error_m": error.total,
        "print_undercut_m": max(0.0, float(printed.max())), "print_overcut_m": max(0.0, -float(printed.min())),
        "surface_shift_m": found.shift, "wiper_overlap_m": found.overlap, "warnings": found.warnings,
        "map": {
            "columns": whole.angle.size, "rows": whole.axial.size, "radius_m": whole.radius,
            "mean_radius_m": whole.mean_radius, "undercut_m": whole.undercut, "overcut_m": whole.overcut,
            "areal": figures(found.areal), "along": figures(found.along), "around": figures(found.around),
        },
    }


def csv_text(found: SurfaceMap) -> str:
    """The map as CSV: axial place down, angle across, heights in m."""
    lines = ["axial_m \\ angle_rad," + ",".join(f"{a:.9g}" for a in found.angle)]
    lines += [f"{z:.9g}," + ",".join(f"{h:.4e}" for h in row) for z, row in zip(found.axial, found.height, strict=True)]
    return "\n".join(lines) + "\n"


def ply_bytes(found: SurfaceMap) -> bytes:
    """The map on its cylinder as binary PLY, in m: vertices x, y, z with their height, four-sided faces."""
    m, n = found.height.shape
    radius = found.radius + found.height
    vertices = np.empty((m, n, 4), dtype="<f4")
    vertices[..., 0], vertices[..., 1] = radius * np.cos(found.angle), radius * np.sin(found.angle)
    vertices[..., 2], vertices[..., 3] = found.axial[:, None], found.height
    closed = n * (found.angle[1] - found.angle[0]) > 2 * math.pi - 1e-9
    index = np.arange(m * n, dtype="<i4").reshape(m, n)
    right = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], right[:-1], right[1:], index[1:]], axis=-1)
    quads = quads if closed else quads[:, :-1]
    faces = np.empty(quads.shape[0] * quads.shape[1], dtype=[("count", "u1"), ("corners", "<i4", 4)])
    faces["count"], faces["corners"] = 4, quads.reshape(-1, 4)
    header = ("ply\nformat binary_little_endian 1.0\ncomment turnmill surface, m; quality: height above the programmed "
              f"radius\nelement vertex {m * n}\nproperty float x\nproperty float y\nproperty float z\n"
              f"property float quality\nelement face {faces.size}\nproperty list uchar int vertex_indices\n"
              "end_header\n")
    return header.encode("ascii") + vertices.tobytes() + faces.tobytes()


@dataclass(frozen=True, eq=False)
class Study:
    """Form error over speeds and depths (Figures 5.6 to 5.8).

    tool_speeds (n,) [rad/s]; depths (m,) [m]; workpiece_speed [rad/s]; total (m, n) [m].
    """

    tool_speeds: Floats
    depths: Floats
    workpiece_speed: float
    total: Floats

    @property
    def ratios(self) -> Floats:
        """Tool speed over workpiece speed (n,)."""
        return np.asarray(self.tool_speeds / abs(self.workpiece_speed), dtype=np.float64)


def study(
    op: Operation, cut: Conditions, speeds: int = 8, depths: int = 12, progress: Callable[[float], None] | None = None,
) -> Study:
    """Form error at tool speeds from a half to two times the cut's, and depths from a quarter to twice its depth."""
    tool_speeds = np.geomspace(0.5, 2.0, speeds) * cut.tool_speed
    deepest = min(2 * cut.depth, op.tool.flute_length, 0.9 * op.workpiece.radius)
    places = np.linspace(0.25 * cut.depth, deepest, depths)
    total = np.empty((depths, speeds))
    for i, depth in enumerate(places):
        for j, speed in enumerate(tool_speeds):
            total[i, j] = form_error(op, with_cut(op, float(speed), cut.workpiece_speed, float(depth))).total
        if progress is not None:
            progress((i + 1) / depths)
    return Study(tool_speeds, places, cut.workpiece_speed, total)
