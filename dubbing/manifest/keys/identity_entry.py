"""The entry of an identity in a manifest: keys, types, defaults."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from dubbing.engine.disk.numbered import numbered, plain, with_options
from dubbing.manifest.keys.consent_entry import Consent, read_form
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.values import (
    BEST,
    LEARNED_SECONDS,
    LONGEST_SECONDS,
    SIZES,
    FilePath,
    LearnedSeconds,
    PathText,
    Rate,
    Seconds,
    check_words,
)


class Finetune(Entry):
    """Settings of the fine-tune; the preset's if left out."""

    iterations: int | None = Field(default=None, ge=1, le=10**9)
    """Training steps. Without: as many as a dub needs, 60; 250 of a head that turns."""
    learning_rate: float | None = Field(default=None, gt=0, le=0.1)
    """Learning rate of Adam in the first step."""
    rays: int | None = Field(default=None, ge=64, le=10**6)
    """Rays in a step. Without: 3,072, or half in the 60 steps that a dub needs; 850 of `paper`."""
    references: int | None = Field(default=None, ge=1, le=64)
    """References, the same in every frame; preset `fast` only."""


class FacePoint(Entry):
    """A point inside a face."""

    at: Seconds = Field(ge=0, le=LONGEST_SECONDS)
    """When, in the clip."""
    x: float = Field(ge=0, le=1)
    """Share of the frame's width, from the left."""
    y: float = Field(ge=0, le=1)
    """Share of the frame's height, from the top."""
    clip: FilePath | None = None
    """Which of the person's clips; the first if left out."""


FacePoints = Annotated[
    tuple[FacePoint, ...],
    BeforeValidator(
        lambda value: tuple(value) if isinstance(value, list) else (value,),
        json_schema_input_type=FacePoint | list[FacePoint],
    ),
]


class Colour(Entry):
    """Colour spaces of clips, as OpenColorIO names them."""

    film: Annotated[str, AfterValidator(check_words)]
    """Of the clips: `ACEScg`, `LogC4`, `S-Log3 S-Gamut3.Cine`, `Rec.2100-PQ - Display`."""
    working: Annotated[str, AfterValidator(check_words)] | None = None
    """In which faces are found, learned and rendered: a display's; sRGB if left out."""
    clips: tuple[FilePath, ...] = Field(default=(), strict=False)
    """The clips that are in it; if left out, image sequences, or all where no clip is one."""

    @property
    def spaces(self) -> dict[str, str]:
        """The colour spaces by their keys."""
        return self.model_dump(exclude={"clips"}, exclude_none=True)


class Identity(Entry):
    """A person: clips, what to learn from them, and who agreed to it."""

    clip: FilePath
    """A video of this person, with sound; or image sequences, `shot.####.exr`, to dub. Give `clip`
    or `clips`.
    """
    clips: tuple[FilePath, ...] = Field(default=(), strict=False, min_length=1)
    """Several videos of this person, for one model. It is learned from the first clip with enough
    `seconds`; where none has enough, from all clips together.
    """
    rate: Rate | None = None
    """Frames a second of clips that are image sequences; their headers' if left out."""
    colour: Colour | None = None
    """Colour spaces of clips; those that they say if left out, as PQ, HLG and EXR do."""
    face: FacePoints = ()
    """A point in this person's face, where a clip shows several faces, or is not known by their
    looks; one, or a list. Other shots and clips follow by looks.
    """
    start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS)
    """Where in the clip to begin to learn."""
    seconds: LearnedSeconds = LEARNED_SECONDS
    """How many seconds to learn from, or `best`: the 15 s of all clips that vary most. Up to 40
    frames beside them, in which the head is turned further, are learned too.
    """
    consent: Annotated[
        Consent, BeforeValidator(read_form, json_schema_input_type=PathText | Consent)
    ]
    """Who agreed to be dubbed, or the path of a form that `dfrf consent` wrote."""
    preset: Literal["fast", "paper", "ad-nerf", "nerf"] = "fast"
    """Kind of model: `fast`; `paper`, the published sizes; two baselines."""
    seed: int = Field(default=0, ge=0, lt=2**31)
    """Seed of the fine-tune."""
    speech: Literal["mel", "rnn", "hubert", "wav2vec2", "deepspeech"] = "rnn"
    """Speech features that the model hears; its base must know the same ones."""
    speech_weights: FilePath | None = None
    """Weights of the speech features, where they are yours: a folder, or a file."""
    size: int = Field(default=SIZES[-1], ge=SIZES.start, le=SIZES[-1], multiple_of=SIZES.step)
    """Most pixels of the head crop's side, which never has more than the film. A smaller crop is
    faster, and softer in a close-up.
    """
    base: FilePath | None = None
    """Base checkpoint to start from; the one that comes with the preset if left out."""
    finetune: Finetune = Finetune()
    """Settings of the fine-tune."""
    _beside: tuple[Path, ...] = PrivateAttr(())

    @property
    def sequences(self) -> tuple[Path, ...]:
        """Those of its clips that are image sequences."""
        return tuple(film for film in self.films if numbered(film))

    def with_options(self) -> Self:
        """The same with paths of clips that say how they are read."""
        colour: dict[str, str] = {}
        coloured: tuple[Path, ...] = ()
        if self.colour is not None:
            colour = self.colour.spaces
            coloured = tuple(map(plain, self.colour.clips or self.sequences or self.films))

        def read(path: Path) -> Path:
            rate = {"rate": self.rate} if self.rate and numbered(path) else {}
            return with_options(path, rate | (colour if plain(path) in coloured else {}))

        clip, *clips = map(read, (self.clip, *self.clips))
        return self.model_copy(update={"clip": clip, "clips": tuple(clips)})

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

    def film_of(self, point: FacePoint) -> Path | None:
        """The clip that a point lies in; None where it names another one."""
        named = plain(point.clip or self.films[0])
        return next((film for film in self.films if plain(film) == named), None)

    def shown_for(self, clip: Path) -> tuple[Path, tuple[FacePoint, ...]]:
        """By which clip the person is known in one of theirs, and where they are in it.

        That is the clip itself where a point lies in it, else the first, or the main one.
        """
        for film in (clip, self.films[0]):
            if points := tuple(point for point in self.face if self.film_of(point) == film):
                return film, points
        return self.clip, ()
