"""The launch files start exactly the nodes of the table; `launch` itself is stood in for, as pip does not have it."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tests.bag_cases import block, operation, write
from turnmill_ros.node_table import KINDS


class Substitution:
    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: dict[str, str]) -> str:
        return context[self.name]


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch, project: Path) -> Any:
    def record(**fields: Any) -> SimpleNamespace:
        return SimpleNamespace(**fields)

    modules = {
        "launch": {"LaunchDescription": lambda actions: actions},
        "launch.actions": {"OpaqueFunction": record, "DeclareLaunchArgument": lambda name, **k: record(name=name, **k)},
        "launch.substitutions": {"LaunchConfiguration": Substitution},
        "launch_ros": {}, "launch_ros.actions": {"Node": record},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)

    def run(name: str, **given: str) -> list[SimpleNamespace]:
        *declared, last = runpy.run_path(str(project / "launch" / name))["generate_launch_description"]()
        assert given.keys() <= {one.name for one in declared}
        return list(last.function({one.name: given.get(one.name, one.default_value) for one in declared}))

    return run


def by_name(nodes: list[SimpleNamespace]) -> dict[str, SimpleNamespace]:
    assert all(node.arguments == ["-m", KINDS[node.name].module] for node in nodes)
    return {node.name: node for node in nodes}


def test_live(launched: Any, tmp_path: Path) -> None:
    path = tmp_path / "op.yaml"
    path.write_text(operation().text, encoding="utf-8")
    nodes = by_name(launched("live.launch.py", operation=str(path), bag="x.mcap", channels="2"))
    assert nodes.keys() == KINDS.keys() - {"player", "dashboard"}
    assert nodes["operation_server"].parameters[0]["operation_text"] == operation().text
    assert nodes["process_simulator"].parameters[0]["channels"] == ["sound", "tool_x"]
    assert "sensor_blocks=3" in nodes["process_simulator"].parameters[0]["match"]
    assert nodes["recorder"].parameters[0]["linger"] == 3.0


def test_replay(launched: Any, tmp_path: Path) -> None:
    bag = write(tmp_path / "in.mcap", [block(k) for k in range(3)])
    nodes = by_name(launched("replay.launch.py", recording=str(bag), rate="0"))
    assert nodes.keys() == {"player", "force_predictor", "stability_monitor", "chatter_monitor"}
    assert nodes["chatter_monitor"].parameters[0]["prior"] == "computed"
    assert nodes["chatter_monitor"].parameters[0]["axes"] == "recorded"
    assert nodes["player"].parameters[0]["rate"] == 0.0
