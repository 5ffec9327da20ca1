"""Checks of the installation: what is there, and what to do about what is not."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

PROBE = """
import rclpy
from rclpy.utilities import get_rmw_implementation_identifier
rclpy.init()
node = rclpy.create_node("turnmill_doctor")
print(get_rmw_implementation_identifier())
node.destroy_node()
rclpy.shutdown()
"""
MESSAGES_PROBE = """
from turnmill_msgs.msg import SensorBlock
from rclpy.serialization import serialize_message
print(len(serialize_message(SensorBlock(device="doctor"))), "bytes")
"""
ENOUGH_DISK = 1_000_000_000


@dataclass(frozen=True)
class Check:
    """One check: what was found, and a hint where it is not ok."""

    name: str
    ok: bool
    found: str
    hint: str = ""


def checks() -> tuple[Check, ...]:
    """Run all checks. ROS is probed in a child process, so that this one stays free of it."""
    return (_package(), _python(), *_ros(), _domain(), _disk())


def _package() -> Check:
    version = importlib.metadata.version("turnmill")
    return Check("turnmill", True, version)


def _python() -> Check:
    version = ".".join(map(str, sys.version_info[:3]))
    ok = (3, 11) <= sys.version_info[:2] <= (3, 12)
    return Check("Python", ok, version, "" if ok else "use Python 3.11 or 3.12")


def _probe(code: str) -> tuple[bool, str]:
    try:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:
        return False, "no answer within 60 s"
    lines = (done.stdout if done.returncode == 0 else done.stderr).strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else f"exit code {done.returncode}"


def _ros() -> tuple[Check, Check]:
    ok, found = _probe(PROBE)
    ros = Check("ROS 2 node and middleware", ok, found, "" if ok else "pip install 'turnmill[ros]'")
    ok, found = _probe(MESSAGES_PROBE)
    return ros, Check("turnmill_msgs", ok, found, "" if ok else "pip install ./msg_schemas/turnmill_msgs")


def _domain() -> Check:
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    ok = text.isdecimal() and int(text) <= 101
    return Check("ROS_DOMAIN_ID", ok, text, "" if ok else "set a number from 0 to 101")


def _disk() -> Check:
    free = shutil.disk_usage(Path.cwd()).free
    ok = free >= ENOUGH_DISK
    return Check("free disk here", ok, f"{free / 1e9:.1f} GB", "" if ok else "recording needs room")
