"""The table of nodes agrees with the topic table, the node files and the launch files."""

from __future__ import annotations

from pathlib import Path

from turnmill_ros import topics
from turnmill_ros.node_table import KINDS, NodeSpec, live_specs, node_table, replay_specs, with_matches


def matches(specs: tuple[NodeSpec, ...]) -> dict[str, set[str]]:
    return {spec.name: set(spec.parameters.get("match", ())) for spec in with_matches(specs, (topics.CHATTER_STATE,))}


def test_every_node_file_is_in_the_table(project: Path) -> None:
    files = {path.stem for path in (project / "turnmill_ros/nodes").glob("*.py") if not path.stem.startswith("_")}
    assert files == set(KINDS)


def test_every_output_has_one_writer_and_every_input_a_reader() -> None:
    live = [KINDS[spec.name] for spec in live_specs("text", "bag.mcap")]
    for topic in topics.TOPICS:
        if topic not in (topics.DIAGNOSTICS, topics.CLOCK):
            expected = topic is not topics.WRENCH_MEASURED  # a dynamometer, which the simulated machine does not have
            assert sum(topic in kind.outputs for kind in live) == expected, topic.name
            assert any(topic in kind.inputs for kind in live), topic.name


def test_counterparts_of_a_live_run() -> None:
    found = matches(live_specs("text", "bag.mcap"))
    assert "sensor_blocks=3" in found["process_simulator"]
    assert {"joint_states=5", "operation=1"} <= found["controller"]
    assert {"chatter_state=3", "stability_margin=1", "sensor_blocks=1"} <= found["chatter_monitor"]
    assert found["planner"] == {"operation=1", "stability_margin=1", "chatter_state=1", "plan_suggestion=1"}
    assert found["operation_server"] == set()


def test_channels_of_a_live_run() -> None:
    for channels, volts, count in ((None, True, 5), (3, False, 3)):
        spec = next(s for s in live_specs("text", None, channels=channels) if s.name == "process_simulator")
        assert (spec.parameters["volts"], len(spec.parameters["channels"])) == (volts, count)


def test_counterparts_of_a_replay() -> None:
    found = matches(replay_specs("in.mcap", None, rate=0.0, operation_text=None, prior="recorded", axes="recorded"))
    assert found["player"] == {
        "operation=3", "joint_states=3", "sensor_blocks=2", "wrench/measured=1", "recorded/chatter_state=1"}
    monitors = found["chatter_monitor"] | found["stability_monitor"]
    assert not any(entry.startswith("stability_margin") for entry in monitors)
    given = matches(replay_specs("in.mcap", None, rate=1.0, operation_text="text", prior="none", axes="none"))
    assert not any(entry.startswith("operation") for entry in given["player"])
    assert "operation=1" in given["chatter_monitor"]


def test_the_documentation_holds_the_table(project: Path) -> None:
    assert node_table() in (project / "docs/nodes.md").read_text(encoding="utf-8")
