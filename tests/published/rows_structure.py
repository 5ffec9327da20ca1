"""Chuck, workpiece and ram: published modes and limits beside the computed ones, under every assumption.

The tables give the displacement of the chuck's face, not its rotation. Rows with the word "fitted" took the rotation
from the published modes of the aluminium stock; the steel stock is then a prediction.

Sources: A. Comak, Mechanics, Dynamics and Stability of Turn-Milling Operations, PhD thesis, UBC 2018, section 4.3.7;
G. R. Cowper, J. Appl. Mech. 33 (1966) 335-340; J. R. Hutchinson, J. Appl. Mech. 68 (2001) 87-92.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np

from tests.published.row import Row
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_core.operation_structure import CROSS_READINGS, Beam, Chuck, Mode, ShearCoefficient
from turnmill_core.stability.lobes import stability_boundary
from turnmill_core.structure.at import with_cross_reading
from turnmill_core.structure.beam import free_bar, normal_modes, on_chuck
from turnmill_core.structure.profile import stock_profile
from turnmill_core.structure.receptance import chuck_receptance, end_receptances, on_base

RPM = math.pi / 30
PIVOT, ROTATION = 0.26, 6.5e5


def rows() -> list[Row]:
    """Every published number of section 4.3.7 that this room computes."""
    found = (*chuck_tables(), *aluminium(), *steel(), *ram(), *cross_modes())
    return [row._replace(computed=float(row.computed)) for row in found]


@cache
def load(name: str) -> Operation:
    """A shipped operation."""
    return read_operation(shipped_operations()[name])


def modes(op: Operation, chuck: Chuck, shear: ShearCoefficient = "cowper") -> list[float]:
    """First two natural frequencies [Hz] of the operation's bar on a chuck."""
    beam = op.workpiece.beam
    assert beam is not None
    bar = free_bar(stock_profile(op.workpiece), beam.material, shear)
    return [float(f) for f in normal_modes(on_chuck(bar, chuck), 2).frequency]


def printed(op: Operation, plane: str) -> Chuck:
    """The chuck as Table 4.7 gives it, rotation rigid."""
    beam = op.workpiece.beam
    assert beam is not None
    chuck = getattr(beam, f"chuck_{plane}")
    return Chuck(tuple(dataclasses.replace(m, pivot=math.inf) for m in chuck.modes))


def assumptions(op: Operation, plane: str) -> dict[str, Chuck]:
    """The chuck of Table 4.7 with every rotation that was tried."""
    rigid = printed(op, plane)
    rocking = dataclasses.replace(rigid, modes=tuple(dataclasses.replace(m, pivot=PIVOT) for m in rigid.modes))
    return {
        "as printed, rotation rigid": rigid,
        "joint of 6e5 N m/rad": dataclasses.replace(rigid, rotational_stiffness=6e5),
        "joint of 7e5 N m/rad": dataclasses.replace(rigid, rotational_stiffness=7e5),
        "rocking about 0.26 m, rotation rigid": rocking,
        "rocking about 0.26 m, joint of 6.5e5 N m/rad (fitted)": dataclasses.replace(
            rocking, rotational_stiffness=ROTATION),
    }


def chuck_tables() -> list[Row]:
    """Table 4.7: stiffness, frequency and mass belong together."""
    op, published = load("thesis_table_4_7"), {"x": 6.86e7, "y": 4.25e7}
    found = []
    for plane, stiffness in published.items():
        mode = printed(op, plane).modes[0]
        found.append(Row(f"chuck stiffness, {plane.upper() * 2}", "Table 4.7", stiffness / 1e6,
                         mode.mass * (2 * math.pi * mode.frequency) ** 2 / 1e6, "N/um",
                         "m w^2 of the printed frequency and mass"))
    return found


def aluminium() -> list[Row]:
    """Section 4.3.7.2: the aluminium stock under every assumption."""
    op = load("thesis_table_4_7")
    source, found = "section 4.3.7.2, Figure 4.46", []
    for plane in "xy":
        for name, chuck in assumptions(op, plane).items():
            first, second = modes(op, chuck)
            why = name + ("" if plane == "x" else "; the mode of Table 4.7 in y is too soft for 313 Hz on any joint")
            found += [Row(f"aluminium stock in {plane}, first mode", source, 313.0, first, "Hz", why),
                      Row(f"aluminium stock in {plane}, second mode", source, 1150.0, second, "Hz", why)]
    fitted = assumptions(op, "x")["rocking about 0.26 m, joint of 6.5e5 N m/rad (fitted)"]
    first, second = modes(op, fitted, "hutchinson")
    found += [Row("aluminium stock in x, first mode", source, 313.0, first, "Hz", "fitted chuck, Hutchinson's shear "
                  "coefficient instead of Cowper's"),
              Row("aluminium stock in x, second mode", source, 1150.0, second, "Hz", "fitted chuck, Hutchinson's shear "
                  "coefficient instead of Cowper's")]
    for number, frequency in enumerate(translation_only(op, fitted)):
        found.append(Row(f"aluminium stock in x, {('first', 'second')[number]} mode", source, (313.0, 1150.0)[number],
                         frequency, "Hz", "fitted chuck, of which only the displacement's receptance is coupled: what "
                         "is lost when the rotation is not identified"))
    return found


def translation_only(op: Operation, chuck: Chuck) -> list[float]:
    """First two peaks [Hz] where only the displacement's receptance of the chuck is coupled to the bar."""
    beam = op.workpiece.beam
    assert beam is not None
    f = np.arange(150.0, 4500.0, 0.5)
    base = chuck_receptance(chuck, f)
    base[:, 0, 1] = base[:, 1, 0] = base[:, 1, 1] = 0.0
    H = np.abs(on_base(end_receptances(free_bar(stock_profile(op.workpiece), beam.material), f), base)[:, 0, 0])
    return [float(f[k]) for k in np.flatnonzero((H[1:-1] > H[:-2]) & (H[1:-1] > H[2:]))[:2] + 1]


def steel() -> list[Row]:
    """Section 4.3.7.2: the steel stock on the same chucks, a prediction."""
    op, found = load("thesis_table_4_8"), []
    for plane in "xy":
        for name, chuck in assumptions(op, plane).items():
            if plane == "y" and "rocking" in name:
                continue
            found.append(Row(f"steel stock in {plane}, first mode", "section 4.3.7.2, Figure 4.47", 251.0,
                             modes(op, chuck)[0], "Hz", f"{name}; a cylinder of 100 mm and 120 mm, sizes not printed"))
    shipped = op.workpiece.beam
    assert isinstance(shipped, Beam)
    found.append(Row("steel stock in y, first mode", "section 4.3.7.2, Figure 4.47", 251.0,
                     modes(op, shipped.chuck_y)[0], "Hz", "joint of 6.5e5 N m/rad (fitted to the aluminium stock, x)"))
    return found


def ram() -> list[Row]:
    """Section 4.3.7.1: what the listed modes of the ram's ends give."""
    op = load("thesis_table_4_5")
    table = op.tool.structure.table
    assert table is not None
    short, long = (entry[1] for entry in table.modes)

    def peak(mode: Mode) -> float:
        return 1 / (2 * mode.damping * mode.stiffness)

    source = "section 4.3.7.1, Figure 4.40"
    why = "erratum D11: frequency, damping and mass of the text give this; its dynamic stiffness is the modal one"
    found = [
        Row("peak of Y, longest over shortest ram", source, "almost 2", peak(long) / peak(short), "1", why),
        Row("loss of stiffness in Y over the stroke", source, 25.0, 100 * (1 - long.stiffness / short.stiffness), "%",
            "modal stiffness m w^2"),
    ]
    speeds = np.linspace(2000, 12000, 81) * RPM
    for name, place, published in (("shortest", table.places[0], 4.1), ("longest", table.places[1], 2.26)):
        position = (0.0, place[0], -op.conditions.depth, 0.0, 0.0, 0.0)
        limit = stability_boundary(op, speeds, 20e-3, position=position).depth_limit.min() * 1e3
        found.append(Row(f"lowest depth limit of the slot, {name} ram", "section 4.3.7.1, Figure 4.43", published,
                         limit, "mm", "2000 to 12000 rpm; mode in Z: damping and mass of Table 4.9; it limits the "
                         "shortest ram. Both 15 % high, their ratio as printed (coefficients and Z mode are read)"))
    return found


def cross_modes() -> list[Row]:
    """Tables 4.9 and 4.10: the limit of the printed cut with the cross modes in every reading."""
    found = []
    for name, where, test, rpm in (("thesis_table_4_9", "Table 4.9, 3350 and 6 rpm", "chatter at 1.2 mm", 3350),
                                   ("thesis_table_4_10", "Table 4.10, 3500 and 12 rpm", "chatter at 0.6 mm", 3500)):
        op = load(name)
        for reading in CROSS_READINGS:
            bar = dataclasses.replace(op.workpiece, structure=with_cross_reading(op.workpiece.structure, reading))
            limit = stability_boundary(dataclasses.replace(op, workpiece=bar), [rpm * RPM], 12e-3).depth_limit[0] * 1e3
            found.append(Row(f"depth limit, cross modes: {reading}", where, test, limit, "mm",
                             "no reading gives the published level; the print has no mode shapes"))
    return found
