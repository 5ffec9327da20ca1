"""What is wrong with an operation file, in one line."""

from __future__ import annotations

import reprlib
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from .operation_schema import ADAPTER

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class OperationError(ValueError):
    """A bad operation file: one line naming file, key, value and what was expected.

    file: path or name of the text; key: path of the key, such as ``tool.structure.modes[1].frequency``
    (empty where the whole file is meant); problem: the rest of the line.
    """

    def __init__(self, file: str, key: str, problem: str) -> None:
        self.file, self.key, self.problem = file, key, " ".join(problem.split())
        super().__init__(" ".join(f"{file}: {key} {self.problem}".split()))

    def __reduce__(self) -> tuple[type[OperationError], tuple[str, str, str]]:
        return type(self), (self.file, self.key, self.problem)


def shown(value: object) -> str:
    """Short form of any value for an error line."""
    return _SHORT.repr(value)


def key_path(parts: tuple[str | int, ...]) -> str:
    """("tool", "modes", 1, "mass") -> "tool.modes[1].mass"."""
    path = ""
    for part in parts:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += ("." if path else "") + (part if part.isidentifier() else shown(part))
    return path


def _node(parts: tuple[str | int, ...], process: str) -> dict[str, Any]:
    """Node of the JSON Schema at a key path; empty where the path leaves the schema."""
    schema = ADAPTER.json_schema(by_alias=True)
    definitions: dict[str, Any] = schema["$defs"]
    node: dict[str, Any] = {"$ref": schema["discriminator"]["mapping"][process]}
    description = ""
    for part in (*parts, None):
        description = node.get("description", description)
        node = next((n for n in node.get("anyOf", ()) if n.get("type") != "null"), node)
        if "$ref" in node:
            node = definitions[node["$ref"].rsplit("/", 1)[1]]
        if isinstance(part, str):
            node = node.get("properties", {}).get(part, {})
        elif isinstance(part, int):
            node = node.get("items") or (node.get("prefixItems") or [{}])[0]
    return {**node, "description": description or node.get("description", "")}


def _expected(node: dict[str, Any]) -> str:
    text: str = node["description"] or "a value"
    if "examples" in node:
        text += f', with its unit, such as "{node["examples"][0]}"'
    elif node.get("type") == "integer":
        text += ", an integer"
    elif "enum" in node:
        text += ": one of " + ", ".join(node["enum"])
    elif "properties" in node:
        text = "a mapping with " + ", ".join(node.get("required", node["properties"]))
    elif "const" in node:
        text = str(node["const"])
    return text


def first_error(file: str, error: ValidationError, data: dict[str, Any]) -> OperationError:
    """The most telling of pydantic's errors: unknown keys (often a typing error) before the others."""
    errors = error.errors(include_url=False)
    chosen = min(errors, key=lambda e: e["type"] not in ("extra_forbidden", "invalid_key"))
    more = "" if len(errors) == 1 else f" (and {len(errors) - 1} more)"
    kind, where = chosen["type"], chosen["loc"]
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        expected = "expected milling or turn-milling"
        if "process" not in data:
            return OperationError(file, "process", f"is missing, {expected}")
        return OperationError(file, "process", f"is {shown(data['process'])}, {expected}")
    if kind == "invalid_key":
        return OperationError(file, f"key {shown(chosen['input'])}", "is not a text, expected keys that are texts")
    process, parts = str(where[0]), where[1:]
    if kind == "extra_forbidden":
        known = sorted(_node(parts[:-1], process).get("properties", ()))
        close = get_close_matches(str(parts[-1]), known, 1)
        hint = f"did you mean {close[0]}? " if close else ""
        problem = f"is not a known key, {hint}expected one of {', '.join(known)}"
    elif kind == "missing":
        problem = f"is missing, expected {_expected(_node(parts, process))}"
    elif kind in ("quantity", "cross"):
        problem = f"is {shown(chosen['input'])}, expected {chosen['msg']}"
    elif kind.startswith(("model_", "dataclass_")):
        problem = f"is {shown(chosen['input'])}, expected {_expected(_node(parts, process))}"
    else:
        said = chosen["msg"].removeprefix("Input should be ").removeprefix("Tuple should have ")
        problem = f"is {shown(chosen['input'])}, expected {said}"
    return OperationError(file, key_path(parts), problem + more)
