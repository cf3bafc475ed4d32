"""The entry of an edit: how a line's mouth is to differ from what its speech asks for."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from dubbing.manifest.entry import Entry
from dubbing.manifest.values import FilePath

LONGEST_SHIFT = 500  # ms
LONGEST_NOTE = 1000  # characters
MOST_KEYS, LATEST = 1000, 86400.0  # of a line; s


class Key(Entry):
    """How far the lips leave the closed mouth at one moment of a line."""

    at: float = Field(ge=0, le=LATEST, allow_inf_nan=False)
    """Seconds of the line's sound."""
    strength: float = Field(ge=0, le=1.5, allow_inf_nan=False)
    """As `strength` of the line: 0 closes the mouth."""


class Edit(Entry):
    """How the mouth of a line is to differ from what its speech asks for."""

    line: int | None = None
    """Number of the line, as in `.lines.csv`; required in a scene."""
    speaker: str | None = None
    """Who speaks it; required where lines of several speakers have one number."""
    shift: float = Field(default=0.0, ge=-LONGEST_SHIFT, le=LONGEST_SHIFT, allow_inf_nan=False)
    """Milliseconds by which the mouth comes later than the sound; below 0, earlier."""
    strength: float = Field(default=1.0, ge=0, le=1.5, allow_inf_nan=False)
    """How far the lips leave the closed mouth: 0 never, 1 as spoken. Preset `fast` only."""
    keys: list[Key] = Field(default=[], max_length=MOST_KEYS)
    """Moments at which the strength is another; 120 ms beside each it is the line's again."""
    curves: FilePath | None = None
    """A table as `dfrf curves` writes it, whose lips take the place of those heard. Preset `fast`
    only.
    """
    note: str = Field(default="", max_length=LONGEST_NOTE)
    """Text for people; changes nothing."""
    status: Literal["open", "approved", "redo"] = "open"
    """The state of the work on the line; changes nothing."""


Edits = Annotated[
    tuple[Edit, ...],
    BeforeValidator(
        lambda value: tuple(value) if isinstance(value, list) else (value,),
        json_schema_input_type=Edit | list[Edit],
    ),
]
