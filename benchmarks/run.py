"""Run every benchmarks/bench_*.py in a process of its own; print a table, write out/benchmarks.json.

    python benchmarks/run.py [NAME ...]       e.g. python benchmarks/run.py cutting

Figures of different days compare only beside `calibration_s`, the time of one fixed numpy job in the
same process; ratios of one run compare as they are. Peak memory is that of the process, libraries included.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent


def run_one(path: Path) -> dict[str, Any]:
    """Run one benchmark with --json; its figures, its wall time [s] and its peak memory [MB]."""
    begin = time.perf_counter()
    command = [sys.executable, path, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=HERE.parent) as child:
        assert child.stdout is not None
        text = child.stdout.read()
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{path.name} ended with exit code {child.returncode}")
    scale = 1e6 if sys.platform == "darwin" else 1e3  # ru_maxrss: bytes or kB
    return {
        "figures": json.loads(text.strip().splitlines()[-1]),
        "wall_s": time.perf_counter() - begin,
        "peak_memory_mb": usage.ru_maxrss / scale,
    }


def main() -> None:
    """Run what was asked for, or everything."""
    wanted = sys.argv[1:]
    paths = [p for p in sorted(HERE.glob("bench_*.py")) if not wanted or p.stem.removeprefix("bench_") in wanted]
    if not paths:
        names = ", ".join(p.stem.removeprefix("bench_") for p in sorted(HERE.glob("bench_*.py")))
        raise SystemExit(f"no such benchmark: {' '.join(wanted)}; there are: {names}")
    machine = {"machine": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version(),
               "load": os.getloadavg()[0]}
    result: dict[str, Any] = {"machine": machine, "benchmarks": {}}
    print(f"{machine['cores']} cores, Python {machine['python']}, load {machine['load']:.1f} at the start", flush=True)
    for path in paths:
        outcome = result["benchmarks"][path.stem.removeprefix("bench_")] = run_one(path)
        print(f"\n{path.stem}: {outcome['wall_s']:.1f} s, peak memory {outcome['peak_memory_mb']:.0f} MB")
        for name, value in outcome["figures"].items():
            print(f"  {name:48s} {value:12.6g}", flush=True)
    target = HERE.parent / "out" / "benchmarks.json"
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps(result, indent=1), encoding="utf-8")
    print(f"\nwritten: {target.relative_to(HERE.parent)}")


if __name__ == "__main__":
    main()
