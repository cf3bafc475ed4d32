"""Checks of the shapes in signatures: a type checker, just large enough for jaxtyping's hook."""

from __future__ import annotations

import functools
import inspect
import itertools
import types
import typing
from collections.abc import Callable
from typing import Any

from jaxtyping import AbstractArray, config
from torch import Tensor

# Checks of a test: they take half of its time, and what it calls later it mostly called before.
MOST = 20_000


class Budget:
    """Counts the checks of a test, and ends them."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin a test."""
        self._count = itertools.count()
        config.update("jaxtyping_disable", False)

    def spend(self) -> None:
        """Count a check."""
        if next(self._count) == MOST:
            config.update("jaxtyping_disable", True)


BUDGET = Budget()


def is_array(hint: Any) -> bool:
    """Whether a hint names shapes."""
    return isinstance(hint, type) and issubclass(hint, AbstractArray)


def fits(value: object, hint: Any) -> bool:
    """Whether tensors have the shape and type of numbers that a hint asks for.

    Looks into unions and tuples; whatever else a hint says is the business of mypy.
    """
    if is_array(hint):
        return isinstance(value, hint)
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType) and any(map(is_array, parts)):
        shapes = [part for part in parts if is_array(part)]
        return not isinstance(value, Tensor) or any(fits(value, part) for part in shapes)
    if origin is tuple and isinstance(value, tuple) and Ellipsis not in parts:
        return len(value) == len(parts) and all(map(fits, value, parts))
    return True


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """The hints of a function; none where they name what is imported for mypy alone."""
    try:
        return typing.get_type_hints(function)
    except NameError:
        return {}


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, with its array arguments and results checked, as often as a test may."""
    signature = inspect.signature(function)
    # At the first call, when all that the hints name is defined.
    hints = functools.cache(lambda: hints_of(function))

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        BUDGET.spend()
        bound = signature.bind(*args, **kwargs)
        for name, value in bound.arguments.items():
            if not fits(value, hints().get(name)):
                raise TypeError(f"{function.__qualname__}: {name} is no {hints()[name]}")
        result = function(*args, **kwargs)
        if not fits(result, hints().get("return")):
            raise TypeError(f"{function.__qualname__}: the result is no {hints()['return']}")
        return result

    return wrapper
