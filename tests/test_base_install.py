"""Core, analysis and command line work where ROS is not installed."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

# What comes with the extra `ros` or with turnmill_msgs cannot be found, as where it is not installed.
WITHOUT_ROS = """
import sys

class WithoutRos:
    def __init__(self, finder):
        self.finder = finder

    def __getattr__(self, name):
        return getattr(self.finder, name)

    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top in {"rclpy", "rosidl_parser", "ament_index_python"} or top.endswith("_msgs") and name == top:
            return None
        return self.finder.find_spec(name, path, target)

sys.meta_path[:] = [WithoutRos(finder) for finder in sys.meta_path]
"""
IMPORTS = """
import turnmill_core, turnmill_ros.bag, turnmill_ros.analysis, turnmill_ros.report, turnmill_ros.cli
from turnmill_core.operation_file import read_operation, shipped_operations
assert len(shipped_operations()) >= 9
for path in shipped_operations().values():
    read_operation(path)
from turnmill_ros.interfaces import schema_text
assert "first_sample" in schema_text("turnmill_msgs/msg/SensorBlock")
"""
COMMAND = """
from turnmill_ros.cli import main
sys.argv[:] = ["turnmill", *sys.argv[1:]]
main()
"""


def without_ros(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process that cannot import ROS."""
    return subprocess.run([sys.executable, "-c", WITHOUT_ROS + code, *arguments], capture_output=True, text=True,
                          check=False, timeout=120)


def test_the_block_blocks() -> None:
    outcome = without_ros("import rclpy")
    assert outcome.returncode == 1
    assert "No module named 'rclpy'" in outcome.stderr


def test_everything_but_the_nodes_imports() -> None:
    outcome = without_ros(IMPORTS)
    assert outcome.returncode == 0, outcome.stderr


def test_the_command_line_helps() -> None:
    outcome = without_ros(COMMAND, "--help")
    assert outcome.returncode == 0, outcome.stderr
    assert {"analyze", "stability", "replay", "doctor"} <= set(outcome.stdout.split())


def test_a_command_that_needs_ros_says_how_to_get_it(tmp_path: Path) -> None:
    outcome = without_ros(COMMAND, "live", "thesis_table_4_9", "--duration", "1", "-o", str(tmp_path / "x.mcap"))
    assert outcome.returncode == 2
    assert "turnmill[ros]" in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_true_environment_without_ros(project: Path, tmp_path: Path) -> None:
    venv.EnvBuilder(with_pip=True).create(tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    ros = {"PYTHONPATH", "LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    clean = {k: v for k, v in os.environ.items() if k not in ros}

    def run(*arguments: str | Path) -> str:
        return subprocess.run([python, *arguments], check=True, env=clean, cwd=tmp_path, capture_output=True,
                              text=True).stdout

    run("-m", "pip", "install", "-q", "-c", project / "constraints.txt", project)
    run("-c", IMPORTS)
    installed = run("-m", "pip", "list")
    assert "rclpy" not in installed
    assert "ros-" not in installed
