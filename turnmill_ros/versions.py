"""Versions of the software that makes a recording."""

from __future__ import annotations

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def software_versions() -> dict[str, str]:
    """Versions of what made a recording, and the git commit where it runs from a checkout."""
    versions = {"python": platform.python_version()}
    for name in ("turnmill", "turnmill_msgs", "numpy", "scipy", "numba", "mcap", "rosbags"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    root = Path(__file__).resolve().parent.parent
    if (root / ".git").exists():
        try:
            result = subprocess.run(["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40"],
                                    capture_output=True, text=True, timeout=5, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return versions
        if result.returncode == 0:
            versions["git_commit"] = result.stdout.strip()
    return versions
