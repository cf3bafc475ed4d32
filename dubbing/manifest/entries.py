"""The entries of a manifest, identities and dubs: keys, types, defaults."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationInfo,
)

from dubbing.errors import DubbingError
from dubbing.files import read_bounded
from dubbing.manifest import yaml_lines
from dubbing.manifest.values import (
    BEST,
    LEARNED_SECONDS,
    LONGEST_SECONDS,
    SIZES,
    Day,
    FilePath,
    Filled,
    Film,
    Language,
    LearnedSeconds,
    Name,
    ReelTime,
    Seconds,
    Sha256,
    Sounds,
    check_words,
    resolve,
)

MOST_BYTES_OF_FORM = 10**5


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
        form: the form that these terms were read from.
    """

    by: Filled
    date: Day | None = None
    reference: Filled
    languages: Annotated[tuple[Language, ...], Field(min_length=1, strict=False)] | None = None
    until: Day | None = None
    films: Annotated[tuple[Film, ...], Field(min_length=1, strict=False)] | None = None
    file: FilePath | None = None
    sha256: Sha256 | None = None
    form: FilePath | None = None

    def terms(self) -> dict[str, Any]:
        """Everything but where files lie, as plain data; what was left open is left out."""
        terms = self.model_dump(mode="json", exclude={"file", "films", "form"}, exclude_none=True)
        films = [film.name if isinstance(film, Path) else film for film in self.films or ()]
        return {"date": None, **terms, **({"films": films} if films else {})}


def _consent(value: Any, info: ValidationInfo) -> Any:
    """A form that was filled in, where consent is the path of one."""
    if isinstance(value, dict) and "form" in value:
        raise ValueError("form is no key: give the path of a form in place of the keys")
    if not isinstance(value, str):
        return value
    path: Path = resolve(value, info)
    try:
        document = yaml_lines.read(read_bounded(path, MOST_BYTES_OF_FORM).decode())
    except (OSError, ValueError, DubbingError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"the form {path} cannot be read: {reason}") from error
    if document.problems or not isinstance(document.data, dict):
        why = "; ".join(map(str, document.problems)) or "it holds no keys"
        raise ValueError(f"the form {path} cannot be read: {why}")
    if "form" in document.data:
        raise ValueError(f"the form {path} cannot name another")
    for key, written in document.data.items():
        if written in (None, "", []):
            raise ValueError(f"{key} is blank in {path}: fill it in, or delete its line")
    return {**document.data, "form": str(path)}


class Mark(Entry):
    """The invisible mark; ``key``: a file of one's own instead of the installation's key."""

    key: FilePath | None = None


def _mark(value: Any) -> Any:
    if not isinstance(value, bool | dict | Mark):
        raise ValueError("must be true, false or {key: FILE}")
    return ({} if value else None) if isinstance(value, bool) else value


class Credits(Entry):
    """A card after the last frame; its default text names what is AI-made, and who agreed."""

    seconds: Seconds = Field(default=3.0, gt=0, le=60, allow_inf_nan=False)
    text: Annotated[str, Field(max_length=500), AfterValidator(check_words)] | None = None


class Label(Entry):
    """What viewers read: the visible mark over the picture, a card of credits."""

    mark: bool = True
    credits: Credits | None = None


def _label(value: Any) -> Any:
    if not isinstance(value, bool | dict | Label):
        raise ValueError(f"must be true, false or {{mark, credits}}, not {value!r:.60}")
    return {"mark": value} if isinstance(value, bool) else value


class Finetune(Entry):
    """How a person is learned; what is left out is as the preset has it.

    Attributes:
        iterations: steps.
        learning_rate: Adam's first.
        rays: of a step.
        references: so many in every frame, always the same ones; of preset `fast` alone.
    """

    iterations: int | None = Field(default=None, ge=1, le=10**9)
    learning_rate: float | None = Field(default=None, gt=0, le=0.1, allow_inf_nan=False)
    rays: int | None = Field(default=None, ge=64, le=10**6)
    references: int | None = Field(default=None, ge=1, le=64)


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

    ``face`` points at the person where a shot of the first clip shows several faces. In other shots
    and clips the face is recognised by its looks.

    ``clip`` is the one that is learned from; where only ``clips`` are named, the first of them that
    has so many seconds. Where none has, or for the best seconds, it is the longest, and the others
    are learned from with it.
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
    _beside: tuple[Path, ...] = PrivateAttr(())

    @property
    def learned_start(self) -> float | None:
        """Where the seconds begin that it learns from; None where the best are looked for."""
        return None if self.seconds == BEST else self.start

    @property
    def learned_seconds(self) -> float:
        """How many seconds it learns from."""
        return LEARNED_SECONDS if self.seconds == "best" else self.seconds

    @property
    def learned_clips(self) -> tuple[Path, ...]:
        """The clips that it learns from, ``clip`` first."""
        return (self.clip, *self._beside)

    def learning_from(self, clip: Path, *beside: Path) -> Self:
        """The same that learns from a clip, and from others with it."""
        changed = self.model_copy(update={"clip": clip})
        changed._beside = beside
        return changed

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
    reel_start: ReelTime | None = None
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
