"""Decoding a message by the schema in the file, and bringing it to the present schema field by field."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError, get_types_from_msg
from rosbags.typesys.store import Typestore

from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import typestore


class Decoder(NamedTuple):
    """decode: bytes (CDR) to a message of the present class, of the file's own where the type is unknown here.

    upgrades: the file's schema differs from the present one. missing: fields that the file does not know,
    extra: fields that only the file knows ("prior.stamp" for nested ones).
    """

    decode: Callable[[bytes], Any]
    upgrades: bool
    missing: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()


@lru_cache(maxsize=256)
def decoder(name: str, text: str) -> Decoder:
    """Decoder of type `name` ("package/msg/Name") whose embedded ros2msg schema is `text`.

    Raises InputError where the schema cannot be parsed or a field changed to a type that cannot be converted.
    """
    try:
        definitions = get_types_from_msg(text, name)
    except TypesysError as error:
        raise InputError("the embedded schema cannot be parsed", key=name) from error
    present = typestore()
    if all(present.fielddefs.get(key, ((), None))[1] == fields for key, (_, fields) in definitions.items()):
        return Decoder(lambda data: _deserialize(present, name, data), False)
    embedded = Typestore()
    embedded.register(definitions)
    if name not in present.fielddefs:
        return Decoder(lambda data: _deserialize(embedded, name, data), False)
    missing, extra = _compare(embedded, name, "")
    return Decoder(lambda data: upgrade(_deserialize(embedded, name, data), name), True, missing, extra)


def _deserialize(store: Typestore, name: str, data: bytes) -> Any:
    """Message of CDR bytes, which may end in up to 16 bytes of padding.

    ROS' serialize_message pads behind empty arrays of doubles (not so on the wire); rosbags refuses more than 3 bytes.
    """
    try:
        return store.deserialize_cdr(data, name)
    except SerdeError:
        for surplus in (4, 8, 12, 16):
            with suppress(SerdeError):
                return store.deserialize_cdr(data[: len(data) - surplus], name)
        raise


def _compare(embedded: Typestore, name: str, prefix: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    old, new = (dict(store.fielddefs[name][1]) for store in (embedded, typestore()))
    missing = [prefix + field for field in new if field not in old]
    extra = [prefix + field for field in old if field not in new]
    for field in new.keys() & old.keys():
        if _kind(old[field]) != _kind(new[field]):
            raise InputError("a field of the embedded schema changed its kind", key=f"{name} {prefix}{field}",
                             value=_kind(old[field]), expected=_kind(new[field]))
        nested = _nested(new[field])
        if nested is not None and nested in embedded.fielddefs:
            inner = _compare(embedded, nested, f"{prefix}{field}.")
            missing += inner[0]
            extra += inner[1]
    return tuple(sorted(missing)), tuple(sorted(extra))


def _nested(description: Any) -> str | None:
    node, detail = description
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        node, detail = detail[0]
    return detail if node == Nodetype.NAME else None


def _kind(description: Any) -> str:
    """"text", "number" or a message name; with "[]" for arrays."""
    node, detail = description
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return _kind(detail[0]) + "[]"
    if node == Nodetype.NAME:
        return str(detail)
    return "text" if detail[0] == "string" else "number"


def upgrade(message: Any, name: str) -> Any:
    """Message of the present class `name` with the fields of `message`, taken by name.

    Fields that `message` lacks become NaN (floating point), 0, False, "", an empty array (a fixed one: filled
    with NaN or 0) or a nested message of such.
    """
    store = typestore()
    fields = {
        field: _converted(getattr(message, field), description) if hasattr(message, field) else _default(description)
        for field, description in store.fielddefs[name][1]
    }
    return store.types[name](**fields)


def _converted(value: Any, description: Any) -> Any:
    node, detail = description
    if node == Nodetype.NAME:
        return upgrade(value, detail)
    if node == Nodetype.BASE:
        return _scalar(detail[0])(value)
    inner_node, inner = detail[0]
    if inner_node == Nodetype.NAME:
        return [upgrade(item, inner) for item in value]
    if inner[0] == "string":
        return list(value)
    return np.asarray(value, dtype=_dtype(inner[0]))


def _default(description: Any) -> Any:
    node, detail = description
    if node == Nodetype.NAME:
        return upgrade(None, detail)
    if node == Nodetype.BASE:
        kind = _scalar(detail[0])
        return math.nan if kind is float else kind()
    inner_node, inner = detail[0]
    count = detail[1] if node == Nodetype.ARRAY else 0
    if inner_node == Nodetype.NAME:
        return [upgrade(None, inner) for _ in range(count)]
    if inner[0] == "string":
        return [""] * count
    dtype = _dtype(inner[0])
    return np.full(count, math.nan if dtype.kind == "f" else 0, dtype=dtype)


def _scalar(base: str) -> type:
    if base == "string":
        return str
    if base == "bool":
        return bool
    return float if base.startswith("float") else int


def _dtype(base: str) -> np.dtype[Any]:
    return np.dtype({"bool": np.bool_, "byte": np.uint8, "char": np.uint8}.get(base, base))
