"""The entries of a manifest, identities and dubs: keys, types, defaults."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from dubbing.engine.disk.numbered import numbered, plain, with_options
from dubbing.manifest.keys.consent_entry import Consent, read_form
from dubbing.manifest.keys.edit_entry import Edits
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.values import (
    BEST,
    LEARNED_SECONDS,
    LONGEST_SECONDS,
    SIZES,
    FilePath,
    Language,
    LearnedSeconds,
    Name,
    PathText,
    Rate,
    ReelTime,
    Seconds,
    Sounds,
    check_words,
)


class Mark(Entry):
    """The invisible mark: how it is drawn."""

    key: FilePath | None = None
    """A file of 16 to 4096 random bytes; the key of this installation if left out."""


def _mark(value: Any) -> Any:
    if not isinstance(value, bool | dict | Mark):
        raise ValueError("must be true, false or {key: FILE}")
    return ({} if value else None) if isinstance(value, bool) else value


class Credits(Entry):
    """A card of credits after the last frame, in silence."""

    seconds: Seconds = Field(default=3.0, gt=0, le=60)
    """How long the card stays, at most 60 s."""
    text: Annotated[str, Field(max_length=500), AfterValidator(check_words)] | None = None
    """Words of the card; if left out: what is AI-generated, and who agreed to it."""


class Label(Entry):
    """Labels that viewers can read."""

    mark: bool | None = None
    """Write `AI-dubbed` over the image. Without: yes, but for `codec: ffv1`, a master."""
    credits: Credits | None = None
    """Add a card of credits."""


def _label(value: Any) -> Any:
    if not isinstance(value, bool | dict | Label):
        raise ValueError(f"must be true, false or {{mark, credits}}, not {value!r:.60}")
    return {"mark": value} if isinstance(value, bool) else value


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


class Dub(Entry):
    """One result: a person and new speech, or a film and the new lines of its people."""

    name: Name
    """Name of the result's files; IDENTITY_AUDIO or the name of `lines` if left out."""
    identity: str | None = None
    """The person who speaks."""
    clip: FilePath | None = None
    """The film to dub, one of the person's clips; the first one if left out."""
    lines: FilePath | None = None
    """A script with times (SRT, VTT, ASS, TTML, CSV): makes this dub a scene."""
    speakers: dict[str, str] | None = None
    """Names in `lines` -> identities. The lines of other names are left alone."""
    reel_start: ReelTime | None = None
    """Where the film begins on the script's clock; for the script of a whole reel."""
    events: tuple[int, ...] = Field(default=(), strict=False)
    """Numbers of the clips of `timeline` that it is laid over; `dfrf init` writes them."""
    audio: Sounds
    """The new speech: a recording, or in a scene one for each speaker. With `{cue}` or `{cue:03}`
    in its name, one for each line.
    """
    edits: Edits = ()
    """How mouths of lines are to differ from what their speech asks for: an edit, or a list."""
    music_effects: FilePath | None = None
    """Music and effects, which the voices are mixed over."""
    loudness: Literal["r128", "streaming", "none"] = "none"
    """Loudness of each line: `r128` -23 LUFS, `streaming` -27 LUFS, `none` as recorded."""
    language: Language | None = None
    """Language of the new speech; required if a consent is limited to languages."""
    audio_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS)
    """Where in the recording to begin."""
    audio_seconds: Seconds | None = Field(default=None, gt=0, le=LONGEST_SECONDS)
    """How much of the recording to use; to its end if left out."""
    video_start: Seconds = Field(default=0.0, ge=0, le=LONGEST_SECONDS)
    """Where in the film to begin."""
    on_longer_audio: Literal["bounce", "loop", "hold", "cut", "fail"] = "bounce"
    """If speech is longer than the film: run its last shot backwards and forwards, repeat it, hold
    its last frame, cut the speech, or refuse.
    """
    render: Literal["baked", "marched"] = "baked"
    """How heads are made, preset `fast`: `baked` looks density up that was kept when the person was
    learned; `marched` asks the model along every ray, ten times as long.
    """
    frame: Literal["full", "crop"] = "full"
    """`full`: paste the face back into the film. `crop`: the head crop alone."""
    label: Annotated[Label, BeforeValidator(_label, json_schema_input_type=bool | Label)] = Label()
    """The visible mark `AI-dubbed`, and a card of credits. `false`: neither."""
    mark: Annotated[Mark | None, BeforeValidator(_mark, json_schema_input_type=bool | Mark)] = (
        Mark()
    )
    """The invisible mark. `false`: none."""
    certificate: FilePath | None = None
    """Certificate chain (PEM) for signed content credentials; needs `key`."""
    key: FilePath | None = None
    """Private key of `certificate` (PEM)."""
    codec: Literal["h264", "hevc", "prores", "prores4444", "dnxhr", "ffv1"] = "h264"
    """Video codec: `h264` and `hevc` in mp4, `prores` (422 HQ), `prores4444` and `dnxhr` (HQX) in
    mov, lossless `ffv1` in mkv."""
    deliver: Literal["video", "turnover", "sequence"] = "video"
    """Beside the video, of a film that is an image sequence: `turnover`, half-float EXR of what was
    replaced, in layers; `sequence`, whole frames in the film's format.
    """
    audio_rate: Literal[48000, "source"] = 48000
    """Sampling rate of the result in Hz; `source`: that of the recording."""

    def over(self, identities: Mapping[str, Identity]) -> Self:
        """The same with the path of its film as the people in it have it."""
        people = [identities[name] for name in self.people if name in identities]
        films = {plain(film): film for person in people for film in person.films}
        clip = self.clip and films.get(plain(self.clip), self.clip)
        return self.model_copy(update={"clip": clip})

    @property
    def people(self) -> tuple[str, ...]:
        """The identities whose faces it replaces, each once."""
        named = [] if self.identity is None else [self.identity]
        return tuple(dict.fromkeys([*named, *(self.speakers or {}).values()]))
