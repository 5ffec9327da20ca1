"""Axis states along a path file, with the tool and workpiece of an operation; for the commands that follow a path."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from turnmill_ros.cli.output import quantity
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.machine.apt import AptFile
    from turnmill_core.machine.axes import AxisState
    from turnmill_core.operation import Operation

MOST_STATES, RATE = 2000, 50.0


def path_states(
    op: Operation, file: Path, workpiece_speed: str | None, machine_file: Path | None, tool_length: str,
    rate: str | None,
) -> tuple[AptFile, tuple[AxisState, ...]]:
    """The path as it was read, and what the machine's axes do along it.

    Texts are quantities of the command line; without a rate there are at most MOST_STATES states, at most RATE a
    second. Raises InputError or ValueError for a bad file, machine or quantity.
    """
    from turnmill_core.machine.apt import read_apt
    from turnmill_core.machine.kinematics import NT3150, RotaryAxis, with_tool_length
    from turnmill_core.machine.path_motion import axis_states, path_motion
    from turnmill_core.machine.toolpath import with_workpiece_speed
    from turnmill_ros.machine_file import read_machine

    datum = op.workpiece.datum
    machine = dataclasses.replace(NT3150, workpiece_datum=datum, c=RotaryAxis(NT3150.c.direction, datum))
    if machine_file is not None:
        machine, _ = read_machine(machine_file)
        if machine.workpiece_datum != datum:
            raise InputError("the machine's workpiece datum is not that of the operation", file=machine_file,
                             value=machine.workpiece_datum, expected=str(datum))
    length = quantity(tool_length, "m", "--tool-length")
    found = read_apt(file.read_text(encoding="utf-8", errors="replace"), str(file))
    speed = quantity(workpiece_speed, "rad/s", "--workpiece-speed")
    route = found.path if speed is None else with_workpiece_speed(found.path, speed)
    motion = path_motion(with_tool_length(machine, length) if length else machine, route)
    if motion.duration == 0:
        raise InputError("the path has no motion", file=file)
    frequency = quantity(rate, "Hz", "--rate") or min(RATE, MOST_STATES / motion.duration)
    return found, axis_states(motion, route, frequency)
