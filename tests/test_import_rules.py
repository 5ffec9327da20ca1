"""Who may import whom, read from the source with ast; nothing is imported."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE_LIBRARIES = {"numpy", "scipy", "numba"}
OPERATION_LIBRARIES = {"yaml", "pydantic", "pydantic_core", "pint"}  # operation_file and its helpers
# What every room of the core may use are the values; beyond them, one way:
VALUES = {"operation", "prediction", *(f"operation_{part}" for part in (
    "checks", "cutter", "limits", "sensors", "stability", "structure"))}
ROOMS: dict[str, set[str]] = {
    "machine": set(),
    "cutting": {"machine"},
    "structure": set(),
    "stability": {"machine", "cutting", "structure"},
    "process": {"machine", "cutting", "structure", "stability"},
    "monitoring": set(),
    "detection": {"machine", "cutting", "structure", "stability", "process", "monitoring"},
}
# Values of a room that others may use without knowing the room: the simulator makes blocks, the monitor judges them.
SHARED_VALUES = {"process": "turnmill_core.monitoring.blocks."}
# The operation's parser turns an alloy into coefficients; that module rests on the values alone.
PARSER = {"operation_material": "turnmill_core.cutting.alloys."}
ROS_MODULES = {"turnmill_ros.parameters", "turnmill_ros.graph"}


def module_name(path: Path) -> str:
    """Dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(source: str, module: str, is_package: bool = False) -> Iterable[str]:
    """Every module that a source text imports, at any depth, relative imports resolved."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = module.split(".")[: len(module.split(".")) - node.level + is_package]
                base = ".".join([*parent, base] if base else parent)
            for alias in node.names:
                yield f"{base}.{alias.name}"
        elif (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) in {"__import__", "importlib.import_module", "import_module"}
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            yield str(node.args[0].value)


def room(module: str) -> str:
    """The room of the core that a module belongs to: "cutting", "operation", ..."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else ""


def family(name: str) -> str:
    """The operation family (operation, operation_file, ...) counts as one for what the values may use."""
    return "operation" if name.startswith("operation") else name


def breaches(source: str, module: str, is_package: bool = False) -> list[str]:
    """Rules that a module breaks, in words."""
    package = module.split(".")[0]
    found = []
    for name in imports(source, module, is_package):
        top = name.split(".")[0]
        if package == "turnmill_core":
            found += _core_breaches(module, name, top)
        elif package == "turnmill_ros":
            in_node = module.startswith("turnmill_ros.nodes.")
            if top in {"rclpy", "turnmill_msgs"} and not (in_node or module in ROS_MODULES):
                found.append(f"{module} imports {name}: only nodes, parameters and graph know rclpy")
            other = name.removeprefix("turnmill_ros.nodes").lstrip(".").split(".")[0]
            if in_node and name.startswith("turnmill_ros.nodes") and not other.startswith("_"):
                found.append(f"{module} imports {name}: nodes never import each other")
    return found


def _core_breaches(module: str, name: str, top: str) -> list[str]:
    here = room(module)
    if top == "turnmill_core":
        there = room(name)
        if here in SHARED_VALUES and name.startswith(SHARED_VALUES[here]):
            return []
        if here in PARSER and name.startswith(PARSER[here]):
            return []
        if here in ROOMS:
            allowed = VALUES | ROOMS[here] | {here}
        elif family(here) == "operation":
            known = family(there) == "operation" and (here not in VALUES or there in VALUES)
            allowed = {there} if known else set()
        elif here == "prediction":
            allowed = {"operation"}
        else:
            allowed = {there} if here == "" else set()
        return [] if there in allowed or name == "turnmill_core" else [f"{module} imports {name}: against the one way"]
    libraries = CORE_LIBRARIES | (OPERATION_LIBRARIES if family(here) == "operation" and here != "operation" else set())
    if top in sys.stdlib_module_names or top in libraries:
        return []
    return [f"{module} imports {name}: the core knows the standard library, numpy, scipy and numba"]


def sources() -> list[Path]:
    """Source files of the package."""
    return sorted(p for package in ("turnmill_core", "turnmill_ros") for p in (ROOT / package).rglob("*.py")
                  if "msg_schemas" not in p.parts)


def test_no_module_breaks_the_import_rules() -> None:
    files = sources()
    assert len(files) > 10
    found = [b for p in files for b in breaches(p.read_text(encoding="utf-8"), module_name(p), p.name == "__init__.py")]
    assert found == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("turnmill_core.cutting.chip", "import rclpy"),
        ("turnmill_core.cutting.chip", "import yaml"),
        ("turnmill_core.operation", "import pint"),
        ("turnmill_core.operation", "from turnmill_core.cutting.alloys import find_alloy"),
        ("turnmill_core.cutting.chip", "def f():\n    from turnmill_core.stability.margin import x"),
        ("turnmill_core.cutting.chip", "from ..process import simulation"),
        ("turnmill_core.monitoring.chatter", "from turnmill_core.machine.axes import AxisState"),
        ("turnmill_core.stability.margin", "import turnmill_core.process.simulation"),
        ("turnmill_core.process.simulation", "from turnmill_core.monitoring.chatter import update"),
        ("turnmill_core.machine.controller", "from turnmill_core.cutting.loads import cutting_loads"),
        ("turnmill_core.operation", "from turnmill_core.machine import axes"),
        ("turnmill_ros.bag", "import rclpy.serialization"),
        ("turnmill_ros.bag", "from importlib import import_module\nimport_module('rclpy')"),
        ("turnmill_ros.nodes.recorder", "from turnmill_ros.nodes.player import Player"),
        ("turnmill_ros.nodes.recorder", "from . import player"),
    ],
)
def test_each_rule_finds_its_breach(module: str, source: str) -> None:
    assert len(breaches(source, module)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("turnmill_core.operation_file", "import yaml, pydantic, pint\nfrom turnmill_core.operation import Tool"),
        ("turnmill_core.operation_material", "from turnmill_core.cutting.alloys import find_alloy"),
        ("turnmill_core.stability.margin", "from turnmill_core.cutting.loads import cutting_loads"),
        ("turnmill_core.monitoring.chatter", "from turnmill_core.prediction import PredictedType\nimport scipy.signal"),
        ("turnmill_core.cutting.chip", "from . import _kernels\nimport numpy as np"),
        ("turnmill_core.process.simulation", "from turnmill_core.monitoring.blocks import SensorBlock"),
        ("turnmill_ros.nodes.recorder", "from turnmill_ros.nodes._support import Gaps"),
        ("turnmill_ros.nodes.recorder", "import rclpy\nfrom turnmill_ros.bag import BagWriter"),
    ],
)
def test_the_rules_allow_what_they_should(module: str, source: str) -> None:
    assert breaches(source, module) == []
