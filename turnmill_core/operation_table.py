"""An operation as a table for people: rpm, mm, degrees, with the figures that follow from it."""

from __future__ import annotations

import math

from .operation import Operation, Structure, Vector

Rows = list[tuple[str, str]]


def _rpm(speed: float) -> str:
    return f"{speed * 30 / math.pi:.6g} rpm"


def _mm(length: float) -> str:
    return "no limit" if math.isinf(length) else f"{length * 1e3:.6g} mm"


def _shape(shape: Vector) -> str:
    direct = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    return direct.get(shape) or "({:g}, {:g}, {:g})".format(*shape)


def _modes(structure: Structure) -> Rows:
    if not structure.modes:
        return [("structure", "rigid")]
    return [("structure", f"{len(structure.modes)} modes, {structure.frame} frame")] + [
        (
            f"mode {number} in {_shape(mode.shape)}",
            f"{mode.frequency:.6g} Hz, {mode.damping * 100:.6g} %, {mode.mass:.6g} kg, {mode.stiffness / 1e6:.4g} N/um",
        )
        for number, mode in enumerate(structure.modes, 1)
    ]


def describe(op: Operation) -> list[tuple[str, Rows]]:
    """Sections of the operation, each a title and its rows of (key, value with unit)."""
    tool, bar, material, cut = op.tool, op.workpiece, op.material, op.conditions
    tool_rows: Rows = [
        ("name", tool.name), ("diameter", _mm(tool.diameter)), ("teeth", str(tool.teeth)),
        ("helix angle", f"{math.degrees(tool.helix_angle):.6g} deg"), ("flute length", _mm(tool.flute_length)),
    ]
    if tool.pitch_angles:
        tool_rows.append(("pitch angles", ", ".join(f"{math.degrees(p):.6g}" for p in tool.pitch_angles) + " deg"))
    if tool.runout:
        tool_rows.append(("runout", ", ".join(f"{r * 1e6:.6g}" for r in tool.runout) + " um"))
    size: Rows = [("diameter", _mm(bar.diameter)), ("length", _mm(bar.length))] if bar.is_bar else [
        ("length x width x height", " x ".join(_mm(d) for d in (bar.length, bar.width, bar.height)))]
    edge = " ".join(f"{k / 1e3:.6g}" for k in (material.Kte, material.Kre, material.Kae))
    chip = " ".join(f"{k / 1e6:.6g}" for k in (material.Ktc, material.Krc, material.Kac))
    sections = [
        ("operation", [("name", op.name), ("process", op.process), ("machine", op.machine)]),
        ("tool", tool_rows + _modes(tool.structure)),
        ("workpiece", [("name", bar.name), *size, ("datum", ", ".join(_mm(d) for d in bar.datum)),
                       *_modes(bar.structure)]),
        ("material", [("name", material.name), ("Ktc Krc Kac", f"{chip} MPa"), ("Kte Kre Kae", f"{edge} N/mm")]),
        ("cut", _cut_rows(op)),
    ]
    if op.schedule:
        points = [
            (f"{p.time:.6g} s", f"tool {_rpm(p.tool_speed)}, "
             + (f"workpiece {_rpm(p.workpiece_speed)}, " if bar.is_bar else "") + f"depth {_mm(p.depth)}")
            for p in op.schedule
        ]
        sections.append(("schedule", points))
    if cut.in_cut:
        sections.append(("derived", _derived_rows(op)))
    sections.append(("file", [("sha256", op.sha256 or "none")]))
    return sections


def _cut_rows(op: Operation) -> Rows:
    cut, tool = op.conditions, op.tool
    rows: Rows = [("tool speed", _rpm(cut.tool_speed))]
    if op.process == "turn-milling":
        rows += [("workpiece speed", _rpm(cut.workpiece_speed)), ("axial feed", f"{op.axial_feed * 1e3:.6g} mm/rev")]
    else:
        rows.append(("feed per tooth", _mm(op.feed_per_tooth)))
    share = cut.radial_immersion / tool.diameter * 100
    return [*rows, ("depth", _mm(cut.depth)), ("sense", op.milling_sense),
            ("radial immersion", f"{_mm(cut.radial_immersion)} ({share:.4g} % of the diameter)")]


def _derived_rows(op: Operation) -> Rows:
    cut, tool = op.conditions, op.tool
    turns = cut.tool_speed / (2 * math.pi)
    return [
        ("tooth passing frequency", f"{op.tooth_passing_frequency:.6g} Hz"),
        ("cutting speed", f"{cut.tool_speed * tool.radius * 60:.6g} m/min"),
        ("feed speed", f"{cut.feed_speed * 6e4:.6g} mm/min"),
        ("resultant feed per tooth", _mm(cut.resultant_feed_speed / (turns * tool.teeth))),
    ]
