"""The check that docstrings and signatures agree finds what it promises and lets the rest pass."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

GOOD = '''
"""Module."""


def f(speed: float, name: str = "", depth: "NDArray[float]" = 0) -> float:
    """Work with `speed` [rad/s] and `name`; depth [m]. Uses `helper`.

    Args:
        speed: how fast.
    """


def helper() -> None:
    """Help."""


class A:
    """Values: tool_speed [rad/s]; axial depth [m]."""

    tool_speed: float
    axial_depth: float
    count: int
    chip: float  # m, largest chip

    def __post_init__(self) -> None:
        pass


class Loads:
    """The fields of turnmill_msgs/CuttingLoads."""

    tool_torque_mean: float


def _private(x: float):
    pass
'''
BREACHES = [
    ('"""Module."""\n', "", "the module has no docstring"),
    ('    """Help."""\n', "    pass\n", "helper has no docstring"),
    ('    """Values: tool_speed [rad/s]; axial depth [m]."""\n', "", "class A has no docstring"),
    ("`helper`", "`helpers`", "names `helpers`, which does not exist"),
    ("        speed: how fast.", "        velocity: how fast.", "describes velocity, which does not exist"),
    ("; depth [m]", "", "does not mention the quantity depth"),
    ("axial depth [m]", "", "does not mention the field axial_depth"),
    ("  # m, largest chip", "", "does not mention the field chip"),
    ("turnmill_msgs/CuttingLoads", "a message", "does not mention the field tool_torque_mean"),
]


def check(project: Path, folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run the check on one source text."""
    (folder / "module.py").write_text(text, encoding="utf-8")
    command = [sys.executable, str(project / "tools" / "check_docstrings.py"), str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_good_code_passes(project: Path, tmp_path: Path) -> None:
    outcome = check(project, tmp_path, GOOD)
    assert outcome.returncode == 0, outcome.stdout


@pytest.mark.parametrize(("old", "new", "finding"), BREACHES)
def test_each_breach_is_found_alone(project: Path, tmp_path: Path, old: str, new: str, finding: str) -> None:
    assert GOOD.count(old) == 1
    outcome = check(project, tmp_path, GOOD.replace(old, new))
    assert outcome.returncode == 1
    assert finding in outcome.stdout
    assert "1 findings" in outcome.stdout


def test_no_files_is_an_error(project: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(project / "tools" / "check_docstrings.py"), str(tmp_path)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 1
