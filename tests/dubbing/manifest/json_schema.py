"""A validator of JSON Schema, as far as the schema of a manifest needs one."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Iterator
from typing import Any

TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str, datetime.date),  # the parser makes dates of texts that look like one
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}
# Keywords about values of one kind: whether they hold.
CHECKS: dict[str, tuple[tuple[type, ...], Callable[[Any, Any], bool]]] = {
    "pattern": ((str,), lambda value, wanted: re.search(wanted, value) is not None),
    "minLength": ((str,), lambda value, wanted: len(value) >= wanted),
    "maxLength": ((str,), lambda value, wanted: len(value) <= wanted),
    "minimum": ((int, float), lambda value, wanted: value >= wanted),
    "maximum": ((int, float), lambda value, wanted: value <= wanted),
    "exclusiveMinimum": ((int, float), lambda value, wanted: value > wanted),
    "exclusiveMaximum": ((int, float), lambda value, wanted: value < wanted),
    "multipleOf": ((int, float), lambda value, wanted: value % wanted == 0),
    "minItems": ((list,), lambda value, wanted: len(value) >= wanted),
    "minProperties": ((dict,), lambda value, wanted: len(value) >= wanted),
    "required": ((dict,), lambda value, wanted: set(wanted) <= set(value)),
}
PARTS = {"$ref", "type", "const", "enum", "anyOf", "allOf", "if", "then", "items"}
PARTS |= {"properties", "additionalProperties", "propertyNames"}
WITHOUT_EFFECT = {"$schema", "$defs", "title", "description", "default", "format"}


def errors(schema: Any, value: Any, root: Any = None, at: str = "") -> Iterator[str]:
    """Key path and keyword of everything in a value that a schema does not allow."""
    root = schema if root is None else root
    if isinstance(schema, bool):
        if not schema:
            yield f"{at}: not allowed"
        return
    assert set(schema) <= PARTS | set(CHECKS) | WITHOUT_EFFECT, "a keyword that is not known here"

    if "$ref" in schema:
        yield from errors(root["$defs"][schema["$ref"].rpartition("/")[2]], value, root, at)
        return
    yield from _of_itself(schema, value, at)
    yield from _of_others(schema, value, root, at)
    yield from _of_parts(schema, value, root, at)


def _of_itself(schema: dict[str, Any], value: Any, at: str) -> Iterator[str]:
    kinds = schema.get("type", list(TYPES))
    wanted = [kind for name in [kinds] * isinstance(kinds, str) or kinds for kind in TYPES[name]]
    if type(value) not in wanted:
        yield f"{at}: type"
    if "const" in schema and value != schema["const"]:
        yield f"{at}: const"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{at}: enum"
    for keyword, (of, check) in CHECKS.items():
        if keyword in schema and type(value) in of and not check(value, schema[keyword]):
            yield f"{at}: {keyword}"


def _of_others(schema: dict[str, Any], value: Any, root: Any, at: str) -> Iterator[str]:
    """By the schemas that a schema is put together of."""

    def holds(part: Any) -> bool:
        return not any(errors(part, value, root))

    if "anyOf" in schema and not any(map(holds, schema["anyOf"])):
        yield f"{at}: anyOf"
    for part in schema.get("allOf", ()):
        yield from errors(part, value, root, at)
    if "if" in schema and holds(schema["if"]):
        yield from errors(schema["then"], value, root, at)


def _of_parts(schema: dict[str, Any], value: Any, root: Any, at: str) -> Iterator[str]:
    """By the schemas of its items or keys."""
    if isinstance(value, list) and "items" in schema:
        for place, one in enumerate(value):
            yield from errors(schema["items"], one, root, f"{at}[{place}]")
    if isinstance(value, dict):
        known = schema.get("properties", {})
        for key, one in value.items():
            yield from errors(schema.get("propertyNames", True), key, root, f"{at}.{key}")
            other = known.get(key, schema.get("additionalProperties", True))
            yield from errors(other, one, root, f"{at}.{key}".lstrip("."))
