"""The examples run as they stand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def output(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_forces_and_stability() -> None:
    lines = output("examples/forces_and_stability.py").splitlines()
    assert len(lines) == 5
    assert {line.split()[-1] for line in lines[1:]} >= {"STABLE"}


def test_analyze_folder() -> None:
    text = output("examples/analyze_folder.py", "bags")
    demo = next(line for line in text.splitlines() if line.startswith("demo_turn_milling"))
    assert "chatter at 778" in demo
    assert "truncated" in text
