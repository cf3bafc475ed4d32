"""The entry of an edit: how a line's mouth is to differ from what its speech asks for."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.values import FilePath

LONGEST_SHIFT = 500  # ms
LONGEST_NOTE = 1000  # characters
LONGEST_NAME, MOST_TAKES = 60, 100  # characters; of a line
MOST_KEYS, LATEST = 1000, 86400.0  # of a line; s

Second = Annotated[float, Field(ge=0, le=LATEST)]
Strength = Annotated[float, Field(ge=0, le=1.5)]
Style = Literal["as spoken", "softer", "clearer"]


class Key(Entry):
    """How far the lips leave the closed mouth at one moment of a line."""

    at: Second
    """Seconds of the line's sound."""
    strength: Strength
    """As `strength` of the line: 0 closes the mouth."""


class Span(Entry):
    """A part of a line."""

    start: Second
    """Seconds of the line's sound."""
    end: Second
    """Seconds of the line's sound, later than `start`."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.end <= self.start:
            raise ValueError(f"ends at {self.end:g} s, and begins at {self.start:g} s")
        return self


Shift = Annotated[float, Field(ge=-LONGEST_SHIFT, le=LONGEST_SHIFT)]


class Moved(Span):
    """A part of a line whose mouth comes later or earlier than that of the rest."""

    shift: Shift
    """Milliseconds by which it comes later than `shift` of the line says; below 0, earlier."""


def _apart(parts: list[Moved]) -> list[Moved]:
    for before, after in pairwise(sorted(parts, key=lambda part: part.start)):
        if after.start < before.end:
            what = f"the parts from {before.start:g} and from {after.start:g} s overlap"
            raise ValueError(what)
    return parts


Keys = Annotated[list[Key], Field(max_length=MOST_KEYS)]
Spans = Annotated[list[Span], Field(max_length=MOST_KEYS)]
MovedParts = Annotated[list[Moved], Field(max_length=MOST_KEYS), AfterValidator(_apart)]
Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]


class Take(Entry):
    """One of several versions of a line, of which `take` chooses: a recording and an edit."""

    audio: FilePath | None = None
    """Another recording of the line, from its first frame on; that of the manifest if left out."""
    shift: Shift = 0.0
    """As that of the line."""
    strength: Strength = 1.0
    """As that of the line."""
    style: Style = "as spoken"
    """As that of the line."""
    keys: Keys = Field(default=[])
    """As those of the line."""
    curves: FilePath | None = None
    """As those of the line."""
    film_mouth: Spans = Field(default=[])
    """As those of the line."""
    moved: MovedParts = Field(default=[])
    """As those of the line."""


class Edit(Entry):
    """How the mouth of a line is to differ from what its speech asks for."""

    line: int | None = None
    """Number of the line, as in `.lines.csv`; required in a scene."""
    speaker: str | None = None
    """Who speaks it; required where lines of several speakers have one number."""
    shift: Shift = 0.0
    """Milliseconds by which the mouth comes later than the sound; below 0, earlier."""
    strength: Strength = 1.0
    """How far the lips leave the closed mouth: 0 never, 1 as spoken. Preset `fast` only."""
    style: Style = "as spoken"
    """`softer`: lips move less and more slowly; `clearer`: they open and close further. Preset
    `fast` only.
    """
    keys: Keys = Field(default=[])
    """Moments at which the strength is another; 120 ms beside each it is the line's again."""
    curves: FilePath | None = None
    """A table as `dfrf curves` writes it, whose lips take the place of those heard. Preset `fast`
    only.
    """
    film_mouth: Spans = Field(default=[])
    """Parts of the line in which the face stays the film's own, as in a laugh."""
    moved: MovedParts = Field(default=[])
    """Parts of the line whose mouth comes later or earlier, as a word; they may not overlap."""
    note: str = Field(default="", max_length=LONGEST_NOTE)
    """Text for people; changes nothing."""
    status: Literal["open", "approved", "redo"] = "open"
    """The state of the work on the line; changes nothing."""
    take: str = ""
    """The name of the take that is used; without it, the keys above, and the recording in `audio`
    of the dub.
    """
    takes: dict[Name, Take] = Field(default={}, max_length=MOST_TAKES)
    """Other versions of the line, by names of your own."""


Edits = Annotated[
    tuple[Edit, ...],
    BeforeValidator(
        lambda value: tuple(value) if isinstance(value, list) else (value,),
        json_schema_input_type=Edit | list[Edit],
    ),
]
