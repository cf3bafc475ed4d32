"""The consent of a person in a manifest: keys, or a form that was filled in."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo
from pydantic.json_schema import SkipJsonSchema

from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.values import Day, FilePath, Filled, Film, Language, Sha256, resolve

MOST_BYTES_OF_FORM = 10**5


class Consent(Entry):
    """Who agreed to be dubbed, when, to what, and where that is written down."""

    by: Filled
    """First and last name of who agreed."""
    date: Day | None = None
    """The day on which they agreed; no day to come."""
    reference: Filled
    """Where the signed copy is kept."""
    languages: Annotated[tuple[Language, ...], Field(min_length=1, strict=False)] | None = None
    """Languages that they agreed to, as `it` or `pt-BR`; any if left out."""
    until: Day | None = None
    """The last day on which a dub may be made; no end if left out."""
    films: Annotated[tuple[Film, ...], Field(min_length=1, strict=False)] | None = None
    """Films that they agreed to: files, or SHA-256 of files; any if left out."""
    file: FilePath | None = None
    """The signed copy, as a file."""
    sha256: Sha256 | None = None
    """SHA-256 of `file`; a file with another one is refused."""
    form: SkipJsonSchema[FilePath | None] = None
    """The form that these terms were read from; no key of a manifest."""

    def terms(self) -> dict[str, Any]:
        """Everything but where files lie, as plain data; what was left open is left out."""
        terms = self.model_dump(mode="json", exclude={"file", "films", "form"}, exclude_none=True)
        films = [film.name if isinstance(film, Path) else film for film in self.films or ()]
        return {"date": None, **terms, **({"films": films} if films else {})}


def read_form(value: Any, info: ValidationInfo) -> Any:
    """Keys of a form that was filled in, where consent is the path of one."""
    if isinstance(value, dict) and "form" in value:
        raise ValueError("form is no key: give the path of a form in place of the keys")
    if not isinstance(value, str):
        return value
    path: Path = resolve(value, info)
    try:
        document = yaml_lines.read_file(path, MOST_BYTES_OF_FORM)
    except ValueError as error:
        raise ValueError(f"the form {path} {error}") from error
    if document.problems or not isinstance(document.data, dict):
        why = "; ".join(map(str, document.problems)) or "it holds no keys"
        raise ValueError(f"the form {path} cannot be read: {why}")
    if "form" in document.data:
        raise ValueError(f"the form {path} cannot name another")
    for key, written in document.data.items():
        if written in (None, "", []):
            raise ValueError(f"{key} is blank in {path}: fill it in, or delete its line")
    return {**document.data, "form": str(path)}
