"""Diagrams computed in a process of their own, asked for by a plain script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = """
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_ros.lobe_process import LobeProcess, LobeRequest

print("begins")
op = read_operation(shipped_operations()["milling_benchmark_1dof"])
lobes = LobeProcess()
lobes.want(LobeRequest(op, op.conditions, None, 7, 4))
request, found = lobes.found(60.0)
assert not lobes.busy
print(request.stamp_ns, len(found.tool_speeds), len(found.depths))
"""


def test_a_script_without_a_main_guard_runs_once(tmp_path: Path, project: Path) -> None:
    """Its own lines are not run again by the process that computes."""
    (tmp_path / "ask.py").write_text(SCRIPT, encoding="utf-8")
    done = subprocess.run([sys.executable, tmp_path / "ask.py"], capture_output=True, text=True, cwd=project,
                          timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["begins", "7 4 32"]
