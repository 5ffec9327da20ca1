"""Build backend of the turnmill_msgs wheel: scikit-build-core, told where ROS lies.

The ROS packages on PyPI are ordinary wheels, so in an isolated build they are installed under the
prefix of the build environment. ament and rosidl look for each other in AMENT_PREFIX_PATH and
CMAKE_PREFIX_PATH; this module points both at that prefix and includes wheel.cmake, which adjusts
what differs between a wheel and an ament installation.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from scikit_build_core import build as _backend

HERE = Path(__file__).resolve().parent

build_sdist = _backend.build_sdist
get_requires_for_build_sdist = _backend.get_requires_for_build_sdist
get_requires_for_build_wheel = _backend.get_requires_for_build_wheel
prepare_metadata_for_build_wheel = _backend.prepare_metadata_for_build_wheel


def _ros_prefix() -> Path:
    """Prefix under which pip put the ROS packages: <prefix>/lib/pythonX.Y/site-packages/ament_package."""
    import ament_package

    return Path(ament_package.__file__).resolve().parents[4]


def build_wheel(
    wheel_directory: str,
    config_settings: dict[str, Any] | None = None,
    metadata_directory: str | None = None,
) -> str:
    """Build the wheel (PEP 517)."""
    prefix = str(_ros_prefix())
    for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        os.environ[name] = prefix
    settings = {"cmake.define.CMAKE_PROJECT_INCLUDE": (HERE / "wheel.cmake").as_posix(), **(config_settings or {})}
    return _backend.build_wheel(wheel_directory, settings, metadata_directory)
