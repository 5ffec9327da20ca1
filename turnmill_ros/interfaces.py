"""Message interfaces without ROS: texts, types that rosbags serializes, schemas and type hashes.

The texts of turnmill_msgs travel with the package; standard messages come from rosbags' definitions
of ROS 2 Jazzy (their comments are not kept there).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.msg import denormalize_msgtype
from rosbags.typesys.store import Typestore

Types = Mapping[str, Any]
"""Message classes by name, "package/msg/Name": those of rosbags or those of ROS."""

OWN_PACKAGE = "turnmill_msgs"
_RULE = "=" * 80


@cache
def own_texts() -> dict[str, str]:
    """Texts of all messages of turnmill_msgs, by type name, comments included."""
    folder = files("turnmill_ros") / "msg_schemas" / "msg"
    return {
        f"{OWN_PACKAGE}/msg/{entry.name.removesuffix('.msg')}": entry.read_text("utf-8")
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name) if entry.name.endswith(".msg")
    }


@cache
def typestore() -> Typestore:
    """rosbags' type store with the messages of ROS 2 Jazzy and of turnmill_msgs."""
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions: dict[str, Any] = {}
    for name, text in own_texts().items():
        definitions.update(get_types_from_msg(text, name))
    store.register(definitions)
    return store


def rosbags_types() -> Types:
    """Message classes that `typestore` serializes; arrays in them are numpy arrays."""
    return typestore().types


@cache
def ros_types() -> Types:
    """Generated ROS classes of every type that the suite uses.

    Raises ImportError where ROS or turnmill_msgs is not installed.
    """
    from turnmill_ros.topics import TOPICS

    names = {topic.type for topic in TOPICS} | set(own_texts()) | {
        "builtin_interfaces/msg/Time", "std_msgs/msg/Header", "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Wrench"}
    return {name: getattr(import_module(name.split("/")[0] + ".msg"), name.split("/")[2]) for name in sorted(names)}


def _dependencies(name: str, seen: dict[str, None]) -> dict[str, None]:
    """Names of all messages nested in `name`, in order of appearance."""
    for _, (_, detail) in typestore().fielddefs[name][1]:
        nested = detail if isinstance(detail, str) else detail[0][1] if isinstance(detail[0], tuple) else None
        if isinstance(nested, str) and nested not in seen:
            seen[nested] = None
            _dependencies(nested, seen)
    return seen


@cache
def schema_text(name: str) -> str:
    """Text of a message followed by those of all messages nested in it, as an MCAP ros2msg schema wants it.

    Raises KeyError for a type that neither turnmill_msgs nor ROS 2 Jazzy's common interfaces define.
    """
    own, store = own_texts(), typestore()
    parts = []
    for part in (name, *_dependencies(name, {})):
        text = own[part] if part in own else store.gendefhash(part, {}, ros_version=2)[0]
        parts.append((part, text if text.endswith("\n") else text + "\n"))
    head, *rest = parts
    return head[1] + "".join(f"{_RULE}\nMSG: {denormalize_msgtype(part)}\n{text}" for part, text in rest)


@cache
def type_hash(name: str) -> str:
    """RIHS01 hash of a type, equal to the one that ROS 2 computes."""
    return typestore().hash_rihs01(name)
