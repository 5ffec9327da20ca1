"""Sound files and tables of samples as recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from turnmill_core.machine.axes import AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock, Status
from turnmill_core.operation import Operation
from turnmill_ros.bag_check import UNITS
from turnmill_ros.bag_write import BagWriter
from turnmill_ros.conversions import axes_to_message, block_to_message, operation_to_message
from turnmill_ros.csv_table import Table, read_table
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import rosbags_types
from turnmill_ros.topics import JOINT_STATES, OPERATION, SENSOR_BLOCKS

BLOCK_S = 0.02
START_NS = 1_000_000_000
"""Stamp of the first sample where the file tells no time: one second after the epoch."""
_RATE_TOLERANCE = 1e-3

Progress = Callable[[float], None] | None
Samples = NDArray[np.float32]


@dataclass(frozen=True)
class Imported:
    """What was imported: channel names, sample rate [Hz], samples per channel, and what a reader should know."""

    path: Path
    channels: tuple[str, ...]
    sample_rate: float
    samples: int
    notes: tuple[str, ...]


def import_sound(
    file: str | Path, op: Operation, output: str | Path, *, sample_rate: float | None = None,
    quantity: str | None = None, unit: str | None = None, names: Sequence[str] | None = None,
    start_ns: int = START_NS, axes: Iterable[AxisState] = (), overwrite: bool = False, progress: Progress = None,
) -> Imported:
    """Recording from a sound file (WAV, FLAC and what libsndfile reads), all channels, full scale = 1.

    sample_rate [Hz]: declared, checked against the file. quantity: "sound_pressure" if None; unit: SI unit of
    the samples as they stand in the file, "1" (unknown scale) if None. names: one for each channel.
    axes: axis states in order of time; without them the operation's nominal spindle speed holds. Samples of
    integer files at full scale are flagged as saturated.

    Raises InputError for a file that is no sound, empty, of another rate or number of channels.
    """
    file = Path(file)
    try:
        sound = soundfile.SoundFile(str(file))
    except (soundfile.LibsndfileError, OSError) as error:
        raise InputError("not a sound file that can be read", file=file) from error
    with sound:
        rate = float(sound.samplerate)
        _same_rate(file, rate, sample_rate, 0.0)
        if sound.frames == 0:
            raise InputError("the sound file holds no samples", file=file)
        names = tuple(names) if names else tuple(f"mic{k + 1}" for k in range(sound.channels))
        if len(names) != sound.channels:
            raise InputError("channel names", file=file, value=names, expected=f"{sound.channels} names")
        channels = _channels(file, names, quantity or "sound_pressure", unit or "1")
        limit = 1.0 - 2.0 ** -15 if sound.subtype.startswith("PCM") else np.inf
        size = max(1, round(BLOCK_S * rate))
        notes = [] if unit not in (None, "1") else ["the scale is unknown: samples are shares of full scale"]
        notes.append("the file tells no time: the first sample is stamped 1970-01-01T00:00:01Z"
                     if start_ns == START_NS else "")
        writer = _Writer(file, op, output, overwrite, start_ns, axes)
        with writer.bag:
            done = 0
            for samples in _sound_blocks(file, sound, size):
                writer.block(samples, done, rate, channels, limit)
                done += len(samples)
                if progress is not None:
                    progress(done / sound.frames)
            writer.finish()
        if _cut_short(file):
            notes.append("the file is shorter than its header says: it was cut off, and the rest is missing")
    return Imported(Path(output), names, rate, done, (*filter(None, notes), *writer.notes()))


def import_csv(
    file: str | Path, op: Operation, output: str | Path, *, sample_rate: float | None = None,
    quantity: str | None = None, unit: str | None = None, time_column: str | None = None,
    columns: Sequence[str] | None = None, axes: Iterable[AxisState] = (), overwrite: bool = False,
    progress: Progress = None,
) -> Imported:
    """Recording from a table with a header line; delimiter comma, semicolon or tab.

    time_column: its name (None: a column called time or t); without one sample_rate [Hz] must be given, with
    one it is checked within 0.1 %. Times may jitter by a tenth of the sample period; longer intervals are gaps and
    stay gaps (missing sample indices). columns: what to import (None: those with a unit in their header,
    all but the time if none has one). unit: SI unit of the samples as they stand in the file; None: the one in
    the header, "Accel X (m/s^2)", converted to SI. quantity: what was measured (None: from the unit).
    Empty cells and "nan" become NaN, which the monitor takes for bad samples.

    Raises InputError naming file, row and column for text among the numbers, times that do not ascend or are not
    uniform, unknown columns and units.
    """
    file = Path(file)
    table = read_table(file, time_column, columns, sample_rate, unit, quantity)
    rate = table.sample_rate
    if table.time_name is not None:
        _same_rate(file, rate, sample_rate, _RATE_TOLERANCE)
    channels = tuple(c for name, q, u in table.channels for c in _channels(file, (name,), q, u))
    writer = _Writer(file, op, output, overwrite, table.start_ns, axes)
    with writer.bag:
        for number, (first, samples) in enumerate(_runs(table, max(1, round(BLOCK_S * rate)))):
            writer.block(samples, first, rate, channels, np.inf)
            if progress is not None and number % 50 == 0:
                progress(first / (table.index[-1] + 1))
        writer.finish()
    names = tuple(channel.name for channel in channels)
    return Imported(Path(output), names, rate, len(table.index), (*table.notes, *writer.notes()))


def _sound_blocks(file: Path, sound: soundfile.SoundFile, size: int) -> Iterator[Samples]:
    try:
        yield from sound.blocks(blocksize=size, dtype="float32", always_2d=True)
    except soundfile.LibsndfileError as error:
        raise InputError(f"the sound file is damaged: {str(error).removeprefix('Error : ')}", file=file) from error


def _cut_short(file: Path) -> bool:
    """True for a WAV file with fewer bytes than it should have (libsndfile does not tell)."""
    with file.open("rb") as stream:
        head = stream.read(8)
    return head[:4] == b"RIFF" and int.from_bytes(head[4:8], "little") + 8 > file.stat().st_size


def _runs(table: Table, size: int) -> Iterator[tuple[int, Samples]]:
    """Blocks of at most `size` samples without a gap inside: (index of the first sample, samples)."""
    gaps = np.flatnonzero(np.diff(table.index) != 1) + 1
    for start, stop in zip((0, *gaps), (*gaps, len(table.index)), strict=True):
        for first in range(start, stop, size):
            yield int(table.index[first]), table.samples[first:min(first + size, stop)]


def _same_rate(file: Path, found: float, declared: float | None, tolerance: float) -> None:
    if declared is not None and abs(found - declared) > tolerance * found:
        raise InputError("declared sample rate is not the file's", file=file, key="sample rate",
                         value=f"{declared:g} Hz", expected=f"{found:.6g} Hz")


def _channels(file: Path, names: Sequence[str], quantity: str, unit: str) -> tuple[Channel, ...]:
    if quantity not in UNITS:
        raise InputError("unknown quantity", file=file, value=quantity, expected=", ".join(UNITS))
    if unit not in ("1", UNITS[quantity]):
        raise InputError(f"unit of {quantity}", file=file, value=unit,
                         expected=f"{UNITS[quantity]}, or 1 (unknown scale)")
    status = Status.UNCALIBRATED if unit == "1" else Status.OK
    return tuple(Channel(name, quantity, unit, "", status) for name in names)


class _Writer:
    """Writes operation, axis states and blocks; a block is recorded when its last sample is acquired."""

    def __init__(
        self, file: Path, op: Operation, output: str | Path, overwrite: bool, start_ns: int, axes: Iterable[AxisState],
    ) -> None:
        self.bag = BagWriter(output, overwrite=overwrite, operation=op, metadata={"import": {"source": file.name}})
        self._types = rosbags_types()
        self._device = file.stem
        self._start_ns = start_ns
        self._axes = iter(axes)
        self._next: AxisState | None = next(self._axes, None)
        self._bad = self._saturated = 0
        self.bag.write(OPERATION.absolute(), operation_to_message(op, start_ns, self._types), start_ns)

    def block(self, samples: Samples, first: int, rate: float, channels: tuple[Channel, ...], limit: float) -> None:
        """Write one block; samples whose magnitude reaches `limit` are saturated."""
        saturated = (np.abs(samples) >= limit).any(axis=0)
        self._saturated += int(saturated.any())
        self._bad += int((~np.isfinite(samples)).any(axis=1).sum())
        marked = tuple(
            Channel(c.name, c.quantity, c.unit, c.location, c.status | Status.SATURATED if high else c.status)
            for c, high in zip(channels, saturated, strict=True))
        stamp = self._start_ns + round(first * 1e9 / rate)
        end = self._start_ns + round((first + len(samples) - 1) * 1e9 / rate)
        self._axes_until(end)
        block = SensorBlock(stamp, self._device, 1, first, rate, marked, np.array(samples, dtype=np.float32))
        self.bag.write(SENSOR_BLOCKS.absolute(), block_to_message(block, self._types), end)

    def _axes_until(self, end_ns: float) -> None:
        while self._next is not None and self._next.stamp_ns <= end_ns:
            self.bag.write(JOINT_STATES.absolute(), axes_to_message(self._next, self._types), self._next.stamp_ns)
            self._next = next(self._axes, None)

    def finish(self) -> None:
        """Write the axis states behind the last block."""
        self._axes_until(float("inf"))

    def notes(self) -> list[str]:
        """What was found in the samples."""
        notes = []
        if self._bad:
            notes.append(f"{self._bad} samples are not finite; windows that hold them get no verdict")
        if self._saturated:
            notes.append(f"{self._saturated} blocks reach full scale and are flagged as saturated")
        return notes
