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
from dubbing.printable import is_blank

LONGEST_NAME = 100  # characters
LONGEST_BYTES = files.LONGEST_NAME - len(".sync.json")  # of a name, which a file's name begins with
LONGEST_SECONDS = 1e9
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


FilePath = Annotated[Path, BeforeValidator(_resolve)]
Seconds = Annotated[float, BeforeValidator(_seconds)]
Name = Annotated[str, BeforeValidator(check_name)]
Words = Annotated[str, Field(min_length=1), AfterValidator(_check_words)]


class Entry(BaseModel):
    """Frozen, of exact types, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Consent(Entry):
    """Who agreed to the dubbing of this face, when, and where that is written down."""

    by: Words
    date: datetime.date | None = Field(default=None, strict=False)
    reference: Words


class Mark(Entry):
    """The invisible mark; ``key``: a file of one's own instead of the installation's key."""

    key: FilePath | None = None


def _mark(value: Any) -> Any:
    if not isinstance(value, bool | dict | Mark):
        raise ValueError("must be true, false or {key: FILE}")
    return ({} if value else None) if isinstance(value, bool) else value


class Finetune(Entry):
    """How long to learn; the preset says it by default."""

    iterations: int | None = Field(default=None, ge=1, le=10**9)


class Identity(Entry):
    """A filmed person: a clip, which seconds of it to learn from, and how."""

    clip: FilePath
    start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    seconds: Seconds = Field(default=15.0, gt=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    consent: Consent
    preset: Literal["fast", "paper", "ad-nerf", "nerf"] = "fast"
    seed: int = Field(default=0, ge=0, lt=2**31)
    speech: Literal["mel", "rnn", "hubert", "wav2vec2"] = "rnn"
    speech_weights: FilePath | None = None
    size: int = Field(default=512, ge=SIZES.start, le=SIZES[-1], multiple_of=SIZES.step)
    base: FilePath | None = None
    finetune: Finetune = Finetune()


class Dub(Entry):
    """One result: a person, new speech, and how both are put together."""

    name: Name
    identity: str
    audio: FilePath
    audio_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    audio_seconds: Seconds | None = Field(
        default=None, gt=0, le=LONGEST_SECONDS, allow_inf_nan=False
    )
    video_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS, allow_inf_nan=False)
    on_longer_audio: Literal["bounce", "loop", "hold", "cut", "fail"] = "bounce"
    frame: Literal["full", "crop"] = "full"
    label: bool = True
    mark: Annotated[Mark | None, BeforeValidator(_mark)] = Mark()
    certificate: FilePath | None = None
    key: FilePath | None = None
    codec: Literal["h264", "prores", "ffv1"] = "h264"
    audio_rate: Literal[48000, "source"] = 48000
