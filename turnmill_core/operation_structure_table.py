"""Structures, tables of modes and beams as rows for people."""

from __future__ import annotations

import math

from .operation_structure import Beam, Chuck, CrossMode, Mode, ModeTable, Structure

Rows = list[tuple[str, str]]
_UNITS = {"b": ("deg", 180 / math.pi), "tool_speed": ("rpm", 30 / math.pi)}


def structure_rows(structure: Structure) -> Rows:
    """Modes of a structure, of every place of its table."""
    if not structure.modes and not structure.cross_modes:
        return [("structure", "rigid")]
    count = f"{len(structure.modes) + len(structure.cross_modes)} modes, {structure.frame} frame"
    rows: Rows = [("structure", count)]
    if structure.frame == "rotating":
        rows.append(("turning", f"Coriolis {structure.coriolis}, damping fixed in the {structure.turning_damping}"))
    if structure.heights:
        rows.append(("contact points", ", ".join(f"{h * 1e3:.6g}" for h in structure.heights) + " mm"))
    if structure.table is not None:
        return rows + [row for k in range(len(structure.table.places)) for row in _place_rows(structure.table, k)]
    rows += [_mode_row(n, mode, structure.frame) for n, mode in enumerate(structure.modes, 1)]
    return rows + [_cross_row(cross, structure.cross_reading) for cross in structure.cross_modes]


def _place_rows(table: ModeTable, k: int) -> Rows:
    parts = []
    for name, value in zip(table.axes, table.places[k], strict=True):
        unit, scale = _UNITS.get(name, ("mm", 1e3))
        parts.append(f"{name.replace('_', ' ')} {value * scale:.6g} {unit}")
    return [("at", ", ".join(parts)), *(_mode_row(n, m, "") for n, m in enumerate(table.modes[k], 1))]


def _mode_row(number: int, mode: Mode, frame: str) -> tuple[str, str]:
    names = ("u", "v", "w") if frame == "rotating" else ("x", "y", "z")
    direct = [name for k, name in enumerate(names) if mode.shape == tuple(float(j == k) for j in range(3))]
    shape = direct[0] if direct and not mode.above else "({:g}, {:g}, {:g})".format(*mode.shape)
    more = "".join([
        f", torsion {mode.torsion:.6g} rad/m" if mode.torsion else "",
        f", phase {math.degrees(mode.phase):.4g} deg" if mode.phase else "",
        f", {len(mode.above) + 1} shapes" if mode.above else ""])
    value = f"{mode.frequency:.6g} Hz, {mode.damping * 100:.6g} %, {mode.mass:.6g} kg, {mode.stiffness / 1e6:.4g} N/um"
    return f"mode {number} in {shape}", value + more


def _cross_row(cross: CrossMode, reading: str) -> tuple[str, str]:
    read = "left out" if reading == "none" else f"read as {reading}"
    return f"cross mode in {cross.plane}", (
        f"{cross.frequency:.6g} Hz, {cross.damping * 100:.6g} %, {cross.mass:.6g} kg, {read}")


def beam_rows(beam: Beam) -> Rows:
    """Material, chuck and supports of a bar whose modes follow from its shape."""
    m = beam.material
    rows: Rows = [
        ("modes", f"of a beam, {beam.modes} in each plane, shear coefficient of {beam.shear.capitalize()}"),
        ("material of the bar", f"{m.youngs_modulus / 1e9:.6g} GPa, {m.density:.6g} kg/m^3, "
                                f"Poisson {m.poisson_ratio:g}, loss factor {m.loss_factor:g}"),
    ]
    if beam.bore:
        rows.append(("bore", f"{beam.bore * 1e3:.6g} mm"))
    for plane, chuck in (("x", beam.chuck_x), ("y", beam.chuck_y)):
        rows.append((f"chuck in {plane}", _chuck(chuck)))
    return rows + [("support", f"{s.position * 1e3:.6g} mm from the free end, {s.stiffness / 1e6:.6g} N/um")
                   for s in beam.supports]


def _chuck(chuck: Chuck) -> str:
    parts = []
    for m in chuck.modes:
        rocking = "" if math.isinf(m.pivot) else f" rocking about {m.pivot * 1e3:.6g} mm"
        parts.append(f"{m.frequency:.6g} Hz, {m.damping * 100:.6g} %, {m.mass:.6g} kg{rocking}")
    if not parts:
        parts.append("face stands still")
    if not math.isinf(chuck.stiffness):
        parts.append(f"joint {chuck.stiffness / 1e6:.6g} N/um")
    if not math.isinf(chuck.rotational_stiffness):
        parts.append(f"joint {chuck.rotational_stiffness:.6g} N m/rad")
    return "; ".join(parts)
