"""Which method a model belongs to: the one place that asks."""

from __future__ import annotations

from typing import Any

from dfrf.fast.method import FastMethod
from dfrf.fast.model import FastModel
from dfrf.head_model import HeadModel
from dfrf.method import Method
from dfrf.published.method import PaperMethod
from dfrf.published.model import PaperModel


def method_of(model: HeadModel) -> Method[Any, Any]:
    """How a model learns and renders.

    Raises:
        TypeError: a model of no known kind.
    """
    match model:
        case FastModel():
            return FastMethod(model)
        case PaperModel():
            return PaperMethod(model)
    raise TypeError(f"no method for a {type(model).__name__}")
