"""An operation as a table for people: rpm, mm, degrees, with the figures that follow from it."""

from __future__ import annotations

import math

from .operation import Operation, Shape
from .operation_limits import NO_LIMITS, Limits
from .operation_sensors import Sensors
from .operation_structure_table import beam_rows, structure_rows

Rows = list[tuple[str, str]]


def _rpm(speed: float) -> str:
    return f"{speed * 30 / math.pi:.6g} rpm"


def _mm(length: float) -> str:
    return "no limit" if math.isinf(length) else f"{length * 1e3:.6g} mm"


def _shape_rows(shape: Shape) -> Rows:
    """What the tool has beyond a cylinder."""
    lengths = [(name, getattr(shape, name.replace(" ", "_"))) for name in
               ("corner radius", "corner radial", "corner axial", "wiper length")]
    angles = [(name, getattr(shape, name.replace(" ", "_"))) for name in
              ("tip angle", "taper angle", "bottom clearance")]
    rows: Rows = [(name, _mm(value)) for name, value in lengths if value]
    rows += [(name, f"{math.degrees(value):.6g} deg") for name, value in angles if value]
    if shape.helix_angles:
        rows.append(("helix angles", ", ".join(f"{math.degrees(h):.6g}" for h in shape.helix_angles) + " deg"))
    if shape.axial_runout:
        rows.append(("axial runout", ", ".join(f"{r * 1e6:.6g}" for r in shape.axial_runout) + " um"))
    return rows


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
    tool_rows += _shape_rows(tool.shape)
    size: Rows = [("diameter", _mm(bar.diameter)), ("length", _mm(bar.length))] if bar.is_bar else [
        ("length x width x height", " x ".join(_mm(d) for d in (bar.length, bar.width, bar.height)))]
    if bar.profile:
        size.append(("profile", ", ".join(f"{_mm(2 * r)} at {_mm(z)}" for z, r in bar.profile)))
    edge = " ".join(f"{k / 1e3:.6g}" for k in (material.Kte, material.Kre, material.Kae))
    chip = " ".join(f"{k / 1e6:.6g}" for k in (material.Ktc, material.Krc, material.Kac))
    sections = [
        ("operation", [("name", op.name), ("process", op.process), ("machine", op.machine)]),
        ("tool", tool_rows + structure_rows(tool.structure)),
        ("workpiece", [("name", bar.name), *size, ("datum", ", ".join(_mm(d) for d in bar.datum)),
                       *(structure_rows(bar.structure) if bar.beam is None else beam_rows(bar.beam))]),
        ("material", [("name", material.name), ("Ktc Krc Kac", f"{chip} MPa"), ("Kte Kre Kae", f"{edge} N/mm")]),
        ("cut", _cut_rows(op)),
    ]
    if op.process_damping is not None:
        flank = op.process_damping
        sections.append(("process damping", [
            ("indentation coefficient", f"{flank.indentation:.4g} N/m3"),
            ("contact length of the flank", f"{flank.contact_length * 1e6:.4g} um"),
            ("friction", f"{flank.friction * 100:.4g} %")]))
    if op.trials:
        sections.append(("trials", [
            (f"tool {_rpm(t.tool_speed)}, workpiece {_rpm(t.workpiece_speed)}, {_mm(t.depth)}",
             t.outcome + ("" if t.chatter_frequency is None else f" at {t.chatter_frequency:g} Hz")
             + (f" ({t.note})" if t.note else "")) for t in op.trials]))
    if op.limits != NO_LIMITS:
        sections.append(("limits", _limit_rows(op.limits)))
    if op.sensors.channels:
        sections.append(("sensors", _sensor_rows(op.sensors)))
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


def _limit_rows(limits: Limits) -> Rows:
    length, speed, cutting, force = (lambda v: f"{v * 1e3:.6g} mm"), _rpm, (lambda v: f"{v * 60:.6g} m/min"), (
        lambda v: f"{v:.6g} N")
    kinds = (("chip load", length), ("cutting speed", cutting), ("tool speed", speed), ("workpiece speed", speed),
             ("depth", length), ("feed speed", cutting), ("tool force", force), ("feed force", force),
             ("form error", lambda v: f"{v * 1e6:.6g} um"))
    rows: Rows = []
    for name, text in kinds:
        low = getattr(limits, f"{name.replace(' ', '_')}_min", 0.0)
        high = getattr(limits, f"{name.replace(' ', '_')}_max")
        bounds = [f"at least {text(low)}"] * (low > 0) + [f"at most {text(high)}"] * math.isfinite(high)
        if bounds:
            rows.append((f"{name} ({limits.chip_load})" if name == "chip load" else name, ", ".join(bounds)))
    if limits.stability_margin:
        rows.append(("reserve to the stability limit", f"{limits.stability_margin * 100:.4g} %"))
    for title, ratings in (("tool spindle", limits.tool_spindle), ("workpiece spindle", limits.workpiece_spindle)):
        for r in ratings:
            points = ", ".join(f"{p / 1e3:.4g} kW at {_rpm(s)}" for s, p in zip(r.speeds, r.powers, strict=True))
            time = "continuous" if math.isinf(r.duration) else f"for {r.duration:.6g} s"
            rows.append((f"{title}: {r.name}", f"{points}; {r.load}, {time}"))
    return rows


def _cut_rows(op: Operation) -> Rows:
    cut, tool = op.conditions, op.tool
    rows: Rows = [("tool speed", _rpm(cut.tool_speed))]
    if op.process == "turn-milling":
        rows += [("workpiece speed", _rpm(cut.workpiece_speed)), ("axial feed", f"{op.axial_feed * 1e3:.6g} mm/rev")]
        rows += [("eccentricity", _mm(op.eccentricity))] if op.eccentricity else []
        rows += [("tilt", f"{math.degrees(op.tilt):.6g} deg")] if op.tilt else []
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


_SENSITIVITY = {"fibre probe": (1e-3, "mV/um"), "microphone": (1e3, "mV/Pa"), "accelerometer": (1e3, "mV*s^2/m"),
                "dynamometer": (1e3, "mV/N")}


def _sensor_rows(sensors: Sensors) -> Rows:
    rows: Rows = []
    for s in sensors.channels:
        factor, unit = _SENSITIVITY[s.kind]
        shape = f", shape {100 * s.shape:.4g} %" if s.kind == "fibre probe" or s.shape != 1 else ""
        runout = f", runout {', '.join(f'{r * 1e6:.4g}' for r in s.runout)} um" if s.runout else ""
        noise = "" if s.noise is None else f", noise {s.noise * 1e3:.4g} mV"
        along = "" if s.kind == "microphone" else f" along {s.direction}"
        rows.append((s.name, f"{s.kind}{along}, {s.sensitivity * factor:.4g} {unit}, {s.offset:g} V at zero, "
                             f"{s.lowest:g} to {s.highest:g} V{shape}{runout}{noise}"))
    if sensors.fixture is not None:
        f = sensors.fixture
        rows.append(("fixture", f"{f.frequency:g} Hz, {100 * f.damping:g} %, {f.cross_talk * 1e6:.4g} um/N"))
    if sensors.judged:
        rows.append(("judged", sensors.judged))
    return rows
