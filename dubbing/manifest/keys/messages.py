"""Mistakes that pydantic finds in a manifest, in words for its author."""

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any, get_args

from dubbing.manifest.keys.entry import Entry

DAYS = ("date_type", "date_parsing", "date_from_datetime_parsing", "date_from_datetime_inexact")
LONGEST = 60  # characters of a wrong value in a message
MOST_NAMED = 5  # lines that one sentence names


def plain(detail: Any, model: type[Entry]) -> str:
    """One error of ``ValidationError.errors()`` as a sentence about its key."""
    kind, value = detail["type"], detail.get("input")
    if kind == "extra_forbidden":
        known: Any = model.model_fields
        for part in (part for part in detail["loc"][:-1] if isinstance(part, str)):
            kind_of = known[part].annotation if part in known else None
            kind_of = next(iter(get_args(kind_of)), kind_of)  # an entry, or several
            known = getattr(kind_of, "model_fields", {})
        return "unknown key" + suggestion(str(detail["loc"][-1]), known)
    if kind == "value_error":
        return str(detail["ctx"]["error"])
    if kind == "literal_error":
        return f"must be one of {detail['ctx']['expected']}, not {short(value)}"
    text = {
        "missing": "is required",
        "string_type": f"must be text, not {describe(value)}: put it in quotes",
        "string_too_short": "must not be empty",
        "model_type": f"must hold keys, not {describe(value)}",
        "tuple_type": f"must be a list, not {describe(value)}",
        "too_short": "must not be empty",
        **dict.fromkeys(DAYS, f"must be a day as 2026-11-02, not {short(value)}"),
        "bool_type": f"must be true or false, not {short(value)}",
    }
    sentence = str(detail["msg"]).replace("Input should be", "must be")
    return text.get(kind, f"{sentence}, not {short(value)}")


def suggestion(key: str, known: Iterable[str]) -> str:
    """``; did you mean 'label'?`` where a known key comes close."""
    # Comparing takes the product of the lengths.
    close = difflib.get_close_matches(key, list(known), n=1) if len(key) <= LONGEST else []
    return f"; did you mean {close[0]!r}?" if close else ""


def describe(value: Any) -> str:
    """The kind of a wrong value."""
    kinds = {dict: "keys", list: "a list", str: "text", type(None): "nothing"}
    return kinds.get(type(value), short(value))


def short(value: Any) -> str:
    """A wrong value as it was written, or the beginning of a long one."""
    text = reprlib.repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def some(names: list[str]) -> str:
    """The first few of a list, and how many more there are."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
