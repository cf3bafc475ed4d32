"""Which method a model belongs to: the one place that asks."""

from __future__ import annotations

from typing import Any

from dfrf.field.model import Model
from dfrf.head_model import HeadModel
from dfrf.published.method import PaperMethod
from dfrf.published.model import PaperModel
from dfrf.training.fast_method import FastMethod
from dfrf.training.method import Method


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
