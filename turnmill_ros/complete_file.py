"""A file that is a complete MCAP after every write."""

from __future__ import annotations

import os
import struct
from contextlib import suppress
from pathlib import Path

MAGIC = b"\x89MCAP0\r\n"
# DataEnd (no CRC), Footer (no summary), magic: what makes the records before it a complete MCAP file.
_TAIL = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC


class CompleteFile:
    """Unbuffered file that is a complete MCAP file after every write of whole records.

    Each write puts a short end of file behind the records; the next write goes over it. A killed
    process and a full disk therefore leave a file that readers open.
    """

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0), 0o666)
        self._end = 0
        self._held: list[bytes] | None = None

    def tell(self) -> int:
        """Position [bytes] behind the last record, without the short end."""
        return self._end + sum(map(len, self._held or ()))

    def flush(self) -> None:
        """Nothing is buffered."""

    def write(self, data: bytes) -> int:
        """Write whole records and the short end behind them; OSError leaves the file as it was before."""
        if self._held is not None:
            self._held.append(bytes(data))
        elif data:
            self._put(bytes(data) + _TAIL)
            self._end += len(data)
        return len(data)

    def hold(self) -> None:
        """Keep what is written from now on in memory, for `release`."""
        self._held = []

    def release(self) -> None:
        """Write all that was held at once; it must be the true end of the file."""
        assert self._held is not None
        held, self._held = b"".join(self._held), None
        self._put(held)
        self._end += len(held)

    def _put(self, data: bytes) -> None:
        done = 0
        try:
            os.lseek(self._fd, self._end, os.SEEK_SET)
            while done < len(data):
                done += os.write(self._fd, data[done:])
        except OSError:
            with suppress(OSError):  # without room even for the end, the records before it can be recovered
                os.lseek(self._fd, self._end, os.SEEK_SET)
                os.write(self._fd, _TAIL)
                os.ftruncate(self._fd, self._end + len(_TAIL))
            raise

    def close(self) -> None:
        """Bring the file to the disk and close it."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            try:
                os.fsync(fd)
            finally:
                os.close(fd)
