"""Finding an operation by file or shipped name, and changing single values of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation, shipped_operations
from turnmill_ros.errors import InputError


def find_operation(name: str, changes: Iterable[str] = ()) -> Operation:
    """Operation from a file path or a shipped name, with ``key.path=value`` changes applied.

    A change makes a new operation text (and hash), so that whatever is computed or recorded from
    it says exactly what was used. Raises InputError or OperationError.
    """
    path = Path(name)
    shipped = shipped_operations()
    if not path.is_file():
        stem = path.name.removesuffix(".yaml")
        if stem not in shipped or path.parent != Path("."):
            raise InputError(f"{name}: no such operation file; shipped operations are {', '.join(sorted(shipped))}")
        path = shipped[stem]
    operation = read_operation(path)
    changes = list(changes)
    return parse_operation(changed_text(operation.text, changes), f"{name} with changes") if changes else operation


def changed_text(text: str, changes: Iterable[str]) -> str:
    """Operation text with each ``key.path=value`` set; the path must name an existing mapping."""
    document: dict[str, Any] = yaml.safe_load(text)
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals or not key or not value:
            raise InputError(f"--set {change!r}: expected KEY.PATH=VALUE, for example tool.teeth=4")
        *parents, leaf = key.strip().split(".")
        node: Any = document
        for parent in parents:
            node = node.get(parent) if isinstance(node, dict) else None
            if not isinstance(node, dict):
                raise InputError(f"--set {change!r}: the operation has no mapping {parent!r}")
        node[leaf] = yaml.safe_load(value)
    return yaml.safe_dump(document, sort_keys=False, allow_unicode=True)


def with_material(operation: Operation, material: dict[str, str], source: str) -> Operation:
    """The operation with another material section; `source`, a line, is added to its sources.

    Raises OperationError where the section is not one.
    """
    document: dict[str, Any] = yaml.safe_load(operation.text)
    document["material"] = material
    document["sources"] = f"{document.get('sources', '').rstrip()}\n{source}\n".lstrip()
    return parse_operation(yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100),
                           f"{operation.name} with other material")


def with_structure(operation: Operation, holder: str, section: dict[str, Any], source: str) -> Operation:
    """The operation with another structure section of `holder`, tool or workpiece; `source` is added to its sources.

    Raises OperationError where the section is not one.
    """
    document: dict[str, Any] = yaml.safe_load(operation.text)
    document[holder].pop("beam", None)
    document[holder]["structure"] = section
    document["sources"] = f"{document.get('sources', '').rstrip()}\n{source}\n".lstrip()
    return parse_operation(yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100),
                           f"{operation.name} with other modes")


def with_chuck(operation: Operation, plane: str, section: dict[str, Any], source: str) -> Operation:
    """The operation with another chuck of its bar in `plane`, x or y; `source` is added to its sources.

    Raises OperationError where the section is not one.
    """
    document: dict[str, Any] = yaml.safe_load(operation.text)
    document["workpiece"]["beam"][f"chuck_{plane}"] = section
    document["sources"] = f"{document.get('sources', '').rstrip()}\n{source}\n".lstrip()
    return parse_operation(yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100),
                           f"{operation.name} with another chuck")
