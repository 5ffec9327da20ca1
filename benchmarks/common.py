"""What every benchmark shares: the calibration job, and how its figures are printed."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping

import numpy as np


def calibration() -> float:
    """Time of sorting 200 000 fixed numbers [s], best of 10: how fast the machine is at the moment."""
    values = np.random.default_rng(1).random(200_000)
    took = []
    for _ in range(10):
        begin = time.perf_counter()
        np.sort(values)
        took.append(time.perf_counter() - begin)
    return min(took)


def run(measure: Callable[[], Mapping[str, float]], description: str | None) -> None:
    """Measure and print the figures as a table, with --json as one object."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    as_json = parser.parse_args().json
    figures = measure()
    if as_json:
        print(json.dumps(figures))
        return
    for name, value in figures.items():
        print(f"{name:48s} {value:12.6g}")
