"""Types of the values in a manifest: paths, names, times, words that somebody filled in."""

import datetime
import re
import unicodedata
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, WithJsonSchema

from dubbing.engine.disk import files
from dubbing.media.properties.frame_rate import snap
from dubbing.printable import is_blank
from dubbing.script.line import seconds_of

LONGEST_NAME = 100  # characters
# Bytes of a name, which the name of a file begins with.
LONGEST_BYTES = files.LONGEST_NAME - len(".lines.jsonl")
LONGEST_SECONDS = 1e9
# What a person is learned from: so many seconds, and where the best of the clip are requested.
LEARNED_SECONDS, BEST = 15.0, "best"
# 1:05 or 0:01:05.5; the first number may be larger than 59.
CLOCK = re.compile(r"(?:([0-9]{1,6}):(?=[0-5][0-9]:))?([0-9]{1,6}):([0-5][0-9](?:\.[0-9]*)?)")
# Windows: devices, with any ending, and characters that no name has.
RESERVED = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9¹²³]) *(\..*)?", re.IGNORECASE)
FORBIDDEN = frozenset('<>"|?*')
SIZES = range(64, 1025, 8)  # sides of the head crop, pixels


def resolve(value: Any, info: ValidationInfo) -> Any:
    """A path relative to the folder of the manifest."""
    if not isinstance(value, str) or not value.strip():
        raise ValueError("must be the path of a file")
    return place_of(value, (info.context or {})["folder"])


def place_of(written: str, folder: Path) -> Path:
    """The full path of what a manifest in a folder names; there may be nothing there yet.

    Raises:
        ValueError: no such path is possible, or it may not be read.
    """
    try:
        path = _on_disk((folder / Path(written).expanduser()).resolve())
        check_path(path)
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"cannot be a path: {reason}") from error
    return path


def _on_disk(path: Path) -> Path:
    """The file or folder of a path, also where a Mac wrote its accents in another form."""
    if path.exists() or path == path.parent:
        return path
    folder, name = _on_disk(path.parent), unicodedata.normalize("NFC", path.name)
    if name.isascii() or not folder.is_dir():
        return folder / path.name
    alike = (one for one in folder.iterdir() if unicodedata.normalize("NFC", one.name) == name)
    return next(alike, folder / path.name)


def check_path(path: Path) -> None:
    """Records and reports are UTF-8, and so must be what they name.

    Raises:
        ValueError: the path is not.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise ValueError("its name is no UTF-8: rename the file or folder") from error


def as_name(text: str) -> str:
    """The name of a file as `check_name` takes it: `Screencast 10:47` has a colon, others are long.

    Of a long one its beginning and its end are kept, where languages stand.
    """
    kept = "".join("-" if c in "/\\:" or not c.isprintable() else c for c in text)
    kept = kept.lstrip(" .").rstrip()
    data = kept.encode(errors="replace")
    if len(kept) <= LONGEST_NAME and len(data) <= LONGEST_BYTES:
        return kept
    begin, end = (part.decode(errors="ignore").strip() for part in (data[:64], data[-32:]))
    return f"{begin}-{end}"


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
    if files.WINDOWS and (RESERVED.fullmatch(value) or set(value) & FORBIDDEN or value[-1] == "."):
        raise ValueError("cannot be the name of a file on Windows: give another one")
    return value


def check_words(value: str) -> str:
    if is_blank(value):
        raise ValueError("must not be empty: nothing in it can be read")
    return value


def _seconds(value: Any) -> Any:
    """Seconds of a time like 1:05; anything else as it is."""
    if not isinstance(value, str) or ":" not in value:
        return value
    found = CLOCK.fullmatch(value.strip())
    if found is None:
        raise ValueError(
            f"must be seconds as 65.5, or a time as 1:05.5 or 0:01:05.5, not {value!r:.60}"
        )
    hours, minutes, seconds = found.groups(default="0")
    return 3600 * int(hours) + 60 * int(minutes) + float(seconds)


def _reel_time(value: Any) -> Any:
    """A time of a script's own clock, as text: its timecodes need the rate of a film."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"must be a time as 3600, 1:00:00 or 01:00:00:00, not {value!r:.60}")
    text = value if isinstance(value, str) else f"{value:.9f}"
    seconds_of(text.replace(";", ":"), Fraction(1000))  # whether frames are dropped: see the film
    return text


def _rate(value: Any) -> Any:
    """A frame rate as a fraction, in words: 23.976 is 24000/1001."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"must be a frame rate as 25 or 24000/1001, not {value!r:.60}")
    try:
        rate = Fraction(value).limit_denominator(1001)
    except (ValueError, OverflowError, ZeroDivisionError):
        raise ValueError(f"must be a frame rate as 25 or 24000/1001, not {value!r:.60}") from None
    if not 1 <= rate <= 1000:
        raise ValueError(f"must be 1 to 1000 frames a second, not {value!r:.60}")
    return str(snap(rate))


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
        return resolve(value, info)
    found = {}
    for name, path in value.items():
        if not isinstance(name, str):
            raise ValueError(f"the speaker {name!r} must be text: put it in quotes")
        try:
            found[name] = resolve(path, info)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
    return found


# Placeholders of forms. Compared without case, punctuation and brackets.
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
    words = re.sub(r"[\W_]+", " ", check_words(value).casefold().replace("/", "")).strip()
    if words in PLACEHOLDERS or re.fullmatch(r"\s*[<\[{].*[>\]}]\s*", value):
        raise ValueError(f"{value!r:.60} is a placeholder: fill in what it stands for")
    return value


def _film(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str) and re.fullmatch(SHA256, value):
        return value
    return resolve(value, info)


def _language(value: str) -> str:
    if not LANGUAGE.fullmatch(value):
        raise ValueError(f"must be the code of a language as it or pt-BR, not {value!r:.60}")
    return value


def _sha256(value: str) -> str:
    if not re.fullmatch(SHA256, value):
        raise ValueError(f"must be 64 hexadecimal digits, not {value!r:.80}")
    return value.lower()


SHA256 = "[0-9a-fA-F]{64}"
LANGUAGE = re.compile("[a-zA-Z]{2,3}(-[a-zA-Z0-9]{2,8})*")
# What may be written in a manifest, for its schema.
PathText = Annotated[str, WithJsonSchema({"type": "string", "format": "path", "pattern": r"\S"})]
CLOCK_PATTERN = rf"^\s*(?:{CLOCK.pattern})\s*$"
ClockText = Annotated[
    str, WithJsonSchema({"type": "string", "format": "clock", "pattern": CLOCK_PATTERN})
]
NAME_PATTERN = r"^[^\s./\\:]([^/\\:]*[^\s/\\:])?$"
NameText = Annotated[
    str, WithJsonSchema({"type": "string", "pattern": NAME_PATTERN, "maxLength": LONGEST_NAME})
]
Number = Annotated[float, Field(ge=0, le=LONGEST_SECONDS)]
FilePath = Annotated[Path, BeforeValidator(resolve, json_schema_input_type=PathText)]
# One sound, or one a speaker; a name with {cue} or {cue:03} is a file a line.
Sounds = Annotated[
    Path | dict[str, Path],
    BeforeValidator(_resolve_sounds, json_schema_input_type=PathText | dict[str, PathText]),
]
Seconds = Annotated[float, BeforeValidator(_seconds, json_schema_input_type=Number | ClockText)]
ReelTime = Annotated[str, BeforeValidator(_reel_time, json_schema_input_type=float | str)]
Rate = Annotated[str, BeforeValidator(_rate, json_schema_input_type=float | str)]
LearnedSeconds = Annotated[
    float | Literal["best"],
    BeforeValidator(_learned_seconds, json_schema_input_type=Number | Literal["best"] | ClockText),
]
Name = Annotated[str, BeforeValidator(check_name, json_schema_input_type=NameText)]
Filled = Annotated[str, Field(min_length=1), AfterValidator(_check_filled)]
Day = Annotated[datetime.date, Field(strict=False)]
Language = Annotated[
    str,
    AfterValidator(_language),
    WithJsonSchema({"type": "string", "pattern": f"^{LANGUAGE.pattern}$"}),
]
Film = Annotated[Path | str, BeforeValidator(_film, json_schema_input_type=PathText)]
Sha256 = Annotated[
    str, AfterValidator(_sha256), WithJsonSchema({"type": "string", "pattern": f"^{SHA256}$"})
]
