"""Which method a model belongs to: the one place that asks."""

from __future__ import annotations

from typing import Any

from dfrf.fast import FastMethod
from dfrf.head import HeadModel
from dfrf.method import Method
from dfrf.model import Model
from dfrf.paper import PaperModel
from dfrf.paper_method import PaperMethod


def method_of(model: HeadModel) -> Method[Any, Any]:
    """How a model learns and renders.

    Raises:
        TypeError: a model of no known kind.
    """
    match model:
        case Model():
            return FastMethod(model)
        case PaperModel():
            return PaperMethod(model)
    raise TypeError(f"no method for a {type(model).__name__}")
