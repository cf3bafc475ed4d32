"""What one identity and one dub of a manifest say: keys, types, defaults."""

from __future__ import annotations

import datetime
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
)

from dubbing import files
from dubbing.errors import DubbingError
from dubbing.files import read_bounded
from dubbing.manifest import yaml_lines
from dubbing.printable import is_blank

LONGEST_NAME = 100  # characters
LONGEST_BYTES = files.LONGEST_NAME - len(
    ".lines.jsonl"
)  # of a name, which a file's name begins with
LONGEST_SECONDS = 1e9
# What a person is learned from: so many seconds, and where the best of the clip are asked for.
LEARNED_SECONDS, BEST = 15.0, "best"
# 1:05 or 0:01:05.5; the first number may be larger than 59.
CLOCK = re.compile(r"(?:([0-9]{1,6}):(?=[0-5][0-9]:))?([0-9]{1,6}):([0-5][0-9](?:\.[0-9]*)?)")
SIZES = range(64, 1025, 8)  # sides of the head crop, pixels


def _resolve(value: Any, info: ValidationInfo) -> Any:
    """A path relative to the folder of the manifest."""
    if not isinstance(value, str) or not value.strip():
        raise ValueError("must be the path of a file")
    return place_of(value, (info.context or {})["folder"])


def place_of(written: str, folder: Path) -> Path:
    """The full path that is meant by what a manifest in a folder says; there may be nothing yet.

    Raises:
        ValueError: there can be no such path, or it may not be looked at.
    """
    try:
        path = (folder / Path(written).expanduser()).resolve()
        path.exists()
        check_path(path)
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"cannot be a path: {reason}") from error
    return path


def check_path(path: Path) -> None:
    """Records and reports are UTF-8, and so must be what they name.

    Raises:
        ValueError: the path is not.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise ValueError("its name is no UTF-8: rename the file or folder") from error


def check_name(value: Any) -> Any:
    """A name becomes file and folder names below the output folder."""
    if not isinstance(value, str):
        raise ValueError("must be text: put it in quotes")
    if not value.strip() or len(value) > LONGEST_NAME:
        raise ValueError(f"must have 1 to {LONGEST_NAME} characters")
    if len(value.encode(errors="replace")) > LONGEST_BYTES:
        raise ValueError(f"must have at most {LONGEST_BYTES} bytes in UTF-8: give a shorter name")
    if "/" in value or "\\" in value or ":" in value or value in (".", ".."):
        raise ValueError("would leave the output folder: a name has no '/', '\\' or ':'")
    if value.startswith(".") or value != value.strip() or not value.isprintable():
        raise ValueError("must not start with a dot or a space, nor hold unprintable characters")
    return value


def _check_words(value: str) -> str:
    if is_blank(value):
        raise ValueError("must not be empty: nothing in it can be read")
    return value


def _seconds(value: Any) -> Any:
    """Seconds of what a clock shows; anything else as it is."""
    if not isinstance(value, str) or ":" not in value:
        return value
    found = CLOCK.fullmatch(value.strip())
    if found is None:
        raise ValueError(
            f"must be seconds as 65.5, or a time as 1:05.5 or 0:01:05.5, not {value!r:.60}"
        )
    hours, minutes, seconds = found.groups(default="0")
    return 3600 * int(hours) + 60 * int(minutes) + float(seconds)


def _learned_seconds(value: Any) -> Any:
    """A number of seconds above 0, or `BEST`."""
    number = _seconds(value)
    if number == BEST:
        return BEST
    if isinstance(number, bool) or not isinstance(number, int | float):
        raise ValueError(f"must be a number of seconds or {BEST!r}, not {value!r:.60}")
    if not 0 < number <= LONGEST_SECONDS:
        raise ValueError(f"must be above 0 and at most {LONGEST_SECONDS:g}, not {value!r:.60}")
    return float(number)


def _resolve_sounds(value: Any, info: ValidationInfo) -> Any:
    """A path, or a mapping of speakers to paths."""
    if not isinstance(value, dict):
        return _resolve(value, info)
    found = {}
    for name, path in value.items():
        if not isinstance(name, str):
            raise ValueError(f"the speaker {name!r} must be text: put it in quotes")
        try:
            found[name] = _resolve(path, info)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
    return found


# What stands in forms that nobody filled in. Compared without case, punctuation and brackets.
PLACEHOLDERS = frozenset(
    (
        *("todo", "tbd", "tba", "tbc", "t b d", "fixme", "xx", "xxx", "na", "none", "null"),
        *("unknown", "nobody", "anybody", "anyone", "someone", "somebody", "person", "name"),
        *("your name", "full name", "first name last name", "first and last name", "who agreed"),
        *("reference", "consent", "placeholder", "example", "sample", "fill in", "fill me in"),
        *("to be filled in", "lorem ipsum", "john doe", "jane doe", "foo", "bar"),
    )
)


def _check_filled(value: str) -> str:
    words = re.sub(r"[\W_]+", " ", _check_words(value).casefold().replace("/", "")).strip()
    if words in PLACEHOLDERS or re.fullmatch(r"\s*[<\[{].*[>\]}]\s*", value):
        raise ValueError(f"{value!r:.60} is a placeholder: fill in what it stands for")
    return value


def _film(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str) and re.fullmatch(SHA256, value):
        return value
    return _resolve(value, info)


MOST_BYTES_OF_FORM = 10**5
SHA256 = "[0-9a-fA-F]{64}"
FilePath = Annotated[Path, BeforeValidator(_resolve)]
# One sound, or one a speaker; a name with {cue} or {cue:03} is a file a line.
Sounds = Annotated[Path | dict[str, Path], BeforeValidator(_resolve_sounds)]
Seconds = Annotated[float, BeforeValidator(_seconds)]
LearnedSeconds = Annotated[float | Literal["best"], BeforeValidator(_learned_seconds)]
Name = Annotated[str, BeforeValidator(check_name)]
Filled = Annotated[str, Field(min_length=1), AfterValidator(_check_filled)]
Day = Annotated[datetime.date, Field(strict=False)]
Language = Annotated[str, Field(pattern="^[a-zA-Z]{2,3}(-[a-zA-Z0-9]{2,8})*$")]
Film = Annotated[Path | str, BeforeValidator(_film)]
Sha256 = Annotated[str, Field(pattern=f"^{SHA256}$"), AfterValidator(str.lower)]


class Entry(BaseModel):
    """Frozen, of exact types, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Consent(Entry):
    """Who agreed to the dubbing of this face, when, for what, and where that is written down.

    Attributes:
        languages: codes as ``it`` or ``pt-BR``; any by default.
        until: the last day.
        films: files, or SHA-256 of files; any by default.
        file: what was signed, as a file. sha256: of that file.
    """

    by: Filled
    date: Day | None = None
    reference: Filled
    languages: Annotated[tuple[Language, ...], Field(min_length=1, strict=False)] | None = None
    until: Day | None = None
    films: Annotated[tuple[Film, ...], Field(min_length=1, strict=False)] | None = None
    file: FilePath | None = None
    sha256: Sha256 | None = None

    def terms(self) -> dict[str, Any]:
        """Everything but where files lie, as plain data; what was left open is left out."""
        said = self.model_dump(mode="json", exclude={"file", "films"}, exclude_none=True)
        films = [film.name if isinstance(film, Path) else film for film in self.films or ()]
        return {"date": None, **said, **({"films": films} if films else {})}


def _consent(value: Any, info: ValidationInfo) -> Any:
    """A form that was filled in, where consent is the path of one."""
    if not isinstance(value, str):
        return value
    path: Path = _resolve(value, info)
    try:
        document = yaml_lines.read(read_bounded(path, MOST_BYTES_OF_FORM).decode())
    except (OSError, ValueError, DubbingError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"the form {path} cannot be read: {reason}") from error
    if document.problems or not isinstance(document.data, dict):
        why = "; ".join(map(str, document.problems)) or "it holds no keys"
        raise ValueError(f"the form {path} cannot be read: {why}")
    for key, written in document.data.items():
        if written in (None, "", []):
            raise ValueError(f"{key} is blank in {path}: fill it in, or delete its line")
    return {"file": str(path), **document.data}


class Mark(Entry):
    """The invisible mark; ``key``: a file of one's own instead of the installation's key."""

    key: FilePath | None = None


def _mark(value: Any) -> Any:
    if not isinstance(value, bool | dict | Mark):
        raise ValueError("must be true, false or {key: FILE}")
    return ({} if value else None) if isinstance(value, bool) else value


class Credits(Entry):
    """A card after the last frame; by default it says what is AI-made, and who agreed."""

    seconds: Seconds = Field(default=3.0, gt=0, le=60, allow_inf_nan=False)
    text: Annotated[str, Field(max_length=500), AfterValidator(_check_words)] | None = None


class Label(Entry):
    """What viewers are told: by the visible mark over the picture, by a card of credits."""

    mark: bool = True
    credits: Credits | None = None


def _label(value: Any) -> Any:
    if not isinstance(value, bool | dict | Label):
        raise ValueError(f"must be true, false or {{mark, credits}}, not {value!r:.60}")
    return {"mark": value} if isinstance(value, bool) else value


class Finetune(Entry):
    """How long to learn; the preset says it by default."""

    iterations: int | None = Field(default=None, ge=1, le=10**9)


class FacePoint(Entry):
    """A point inside a face: seconds of the clip, and shares of the frame's width and height."""

    at: Seconds = Field(ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    x: float = Field(ge=0, le=1)
    y: float = Field(ge=0, le=1)


FacePoints = Annotated[
    tuple[FacePoint, ...],
    BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else (value,)),
]


class Identity(Entry):
    """A filmed person: clips, which seconds of which one to learn from, and how.

    ``face`` says whose face it is where a shot of the first clip shows several. In other shots, and
    in other clips, it is looked for by what it looks like.

    ``clip`` is the one that is learned from; where only ``clips`` are named, the first of them that
    has so many seconds, or the longest for the best seconds.
    """

    clip: FilePath
    clips: tuple[FilePath, ...] = Field(default=(), strict=False, min_length=1)
    face: FacePoints = ()
    start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    seconds: LearnedSeconds = LEARNED_SECONDS
    consent: Annotated[Consent, BeforeValidator(_consent)]
    preset: Literal["fast", "paper", "ad-nerf", "nerf"] = "fast"
    seed: int = Field(default=0, ge=0, lt=2**31)
    speech: Literal["mel", "rnn", "hubert", "wav2vec2", "deepspeech"] = "rnn"
    speech_weights: FilePath | None = None
    size: int = Field(default=512, ge=SIZES.start, le=SIZES[-1], multiple_of=SIZES.step)
    base: FilePath | None = None
    finetune: Finetune = Finetune()

    @property
    def learned_start(self) -> float | None:
        """Where the seconds begin that it learns from; None where the best are looked for."""
        return None if self.seconds == BEST else self.start

    @property
    def learned_seconds(self) -> float:
        """How many seconds it learns from."""
        return LEARNED_SECONDS if self.seconds == "best" else self.seconds

    @property
    def films(self) -> tuple[Path, ...]:
        """All its clips, each once; dubs can be made over any."""
        return tuple(dict.fromkeys(self.clips or (self.clip,)))


class Dub(Entry):
    """One result: a person and new speech, or a film and the new lines of its people.

    ``lines`` makes it a scene: see `dubbing.manifest.scenes`. Without, it is a scene of one
    speaker, whose one cue is the whole audio.
    """

    name: Name
    identity: str | None = None
    clip: FilePath | None = None
    lines: FilePath | None = None
    speakers: dict[str, str] | None = None
    audio: Sounds
    music_effects: FilePath | None = None
    loudness: Literal["r128", "streaming", "none"] = "none"
    language: Language | None = None
    audio_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    audio_seconds: Seconds | None = Field(
        default=None, gt=0, le=LONGEST_SECONDS, allow_inf_nan=False
    )
    video_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    on_longer_audio: Literal["bounce", "loop", "hold", "cut", "fail"] = "bounce"
    frame: Literal["full", "crop"] = "full"
    label: Annotated[Label, BeforeValidator(_label)] = Label()
    mark: Annotated[Mark | None, BeforeValidator(_mark)] = Mark()
    certificate: FilePath | None = None
    key: FilePath | None = None
    codec: Literal["h264", "prores", "ffv1"] = "h264"
    audio_rate: Literal[48000, "source"] = 48000

    @property
    def people(self) -> tuple[str, ...]:
        """The identities whose faces it replaces, each once."""
        named = [] if self.identity is None else [self.identity]
        return tuple(dict.fromkeys([*named, *(self.speakers or {}).values()]))
