"""One BLAS thread for small matrices.

OpenBLAS wakes its threads for matrices of a few hundred rows; on a busy machine they wait for each other longer than
they work. numpy and scipy have no switch for it, so the function of the library that they bring is called directly;
where it is not found nothing changes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import scipy

PREFIXES = ("scipy_openblas", "openblas")
SUFFIXES = ("64_", "")


@cache
def _switches() -> tuple[tuple[Callable[[], int], Callable[[int], None]], ...]:
    """Getter and setter of the number of threads of every OpenBLAS that numpy and scipy brought along."""
    found = []
    for package in (np, scipy):
        home = Path(str(package.__file__)).parent
        folders = (home.parent / f"{package.__name__}.libs", home / ".dylibs", home / ".libs")
        for path in (p for folder in folders if folder.is_dir() for p in sorted(folder.glob("*openblas*"))):
            try:
                library = ctypes.CDLL(str(path))
            except OSError:
                continue
            for prefix in PREFIXES:
                for suffix in SUFFIXES:
                    names = [f"{prefix}_{verb}_num_threads{suffix}" for verb in ("get", "set")]
                    if all(hasattr(library, name) for name in names):
                        found.append((getattr(library, names[0]), getattr(library, names[1])))
    return tuple(found)


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra inside runs on one thread; the former number returns afterwards. Holds for the whole process."""
    before = [get() for get, _ in _switches()]
    try:
        for _, put in _switches():
            put(1)
        yield
    finally:
        for (_, put), number in zip(_switches(), before, strict=True):
            put(number)
