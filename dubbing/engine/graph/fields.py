"""The fields of dataclasses: which of them count, and what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache
from typing import Annotated, Any, TypeVar, cast, get_args, get_type_hints

SETTING = object()  # which no literal type holds
Value = TypeVar("Value")
Setting = Annotated[Value, SETTING]  # of a field: no result depends on it
INPUT = object()  # stands for inputs in plain data


def counted(value: Any) -> dict[str, Any]:
    """The fields of a dataclass that are no settings, by name."""
    return {name: getattr(value, name) for name in _counted_fields(cast(Any, type(value)))}


@cache
def _counted_fields(kind: Any) -> tuple[str, ...]:
    hints = get_type_hints(kind, include_extras=True)
    return tuple(f.name for f in fields(kind) if SETTING not in get_args(hints[f.name])[1:])


def without_inputs(name: str, value: Any, inputs: dict[str, Any], kinds: tuple[type, ...]) -> Any:
    """Plain data of a value, as JSON holds it, without its inputs: these go into ``inputs``.

    Args:
        name: of the value; inputs are named after their place in it.
        kinds: types of inputs.

    Returns:
        `INPUT` where nothing but inputs is there.

    Raises:
        TypeError: something there is neither an input nor plain data, or two inputs have one name.
    """

    def inner(of: object, one: Any) -> Any:
        return without_inputs(f"{name} {of}".strip(), one, inputs, kinds)

    if isinstance(value, kinds):
        if name in inputs:
            raise TypeError(f"two inputs are named {name}")
        inputs[name] = value
        return INPUT
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Fraction):
        return str(value)
    if isinstance(value, tuple | list):
        items = [inner(k, one) for k, one in enumerate(value)]
        only_inputs = items and all(one is INPUT for one in items)
        return INPUT if only_inputs else [None if one is INPUT else one for one in items]
    if is_dataclass(value) and not isinstance(value, type):
        value = counted(value)
    if isinstance(value, Mapping):
        named = {str(of): inner(of, one) for of, one in value.items()}
        kept = {of: one for of, one in named.items() if one is not INPUT}
        return INPUT if named and not kept else kept
    raise TypeError(f"{name} is no plain data: {value!r:.80}")


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """The plain data that differs, as ``seed: 0 before, 3 now``; of mappings the innermost keys."""
    found = []
    for name in sorted({*before, *now}):
        one, other = before.get(name), now.get(name)
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            found += differences(one, other)
        elif one != other or (name in before) != (name in now):
            found.append(f"{name}: {one} before, {other} now")
    return found
