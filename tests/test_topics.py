"""The table of topics and its documentation."""

from __future__ import annotations

from pathlib import Path

import pytest

from turnmill_ros import topics
from turnmill_ros.interfaces import rosbags_types, type_hash

TOPICS_PAGE = Path(__file__).parent.parent / "docs" / "topics.md"


def test_names_are_unique_and_relative_but_for_clock_and_diagnostics():
    names = [topic.name for topic in topics.TOPICS]
    assert len(set(names)) == len(names)
    assert {name for name in names if name.startswith("/")} == {"/clock", "/diagnostics"}


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
def test_every_type_is_known(topic):
    assert topic.type in rosbags_types()
    assert type_hash(topic.type).startswith("RIHS01_")


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
def test_history_covers_a_stall_of_one_second(topic):
    assert topic.rate == 0 or topic.depth >= topic.rate or topic.name == "/clock"
    assert not topic.latched or topic.depth == 1


def test_inputs_are_what_a_machine_gives():
    assert {topic.name for topic in topics.INPUTS} == {
        "joint_states", "sensor_blocks", "operation", "wrench/measured"}
    assert not set(topics.INPUTS) & set(topics.OUTPUTS)


@pytest.mark.parametrize(("name", "found"), [
    ("sensor_blocks", topics.SENSOR_BLOCKS),
    ("/sensor_blocks", topics.SENSOR_BLOCKS),
    ("/hall_2/mill/wrench/tool", topics.WRENCH_TOOL),
    ("/tool", None),
    ("/recorded/chatter_state", None),
    ("/mill/recorded/chatter_state", None),
    ("/diagnostics", topics.DIAGNOSTICS),
    ("/camera/image", None),
])
def test_find_ignores_the_namespace(name, found):
    assert topics.find(name) is found


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
def test_find_returns_each_topic_under_its_own_name(topic):
    assert topics.find(topic.absolute("/cell")) is topic


def test_recorded_names_are_relative():
    assert topics.recorded_name("/mill/chatter_state") == "recorded/mill/chatter_state"


def test_documentation_holds_the_table():
    assert topics.topic_table() in TOPICS_PAGE.read_text("utf-8"), (
        "docs/topics.md does not hold the present table; print it with "
        "python -c 'from turnmill_ros.topics import topic_table; print(topic_table())'")
