"""The entry of a dub in a manifest: keys, types, defaults."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field

from dubbing.engine.disk.numbered import plain
from dubbing.manifest.keys.edit_entry import Edits
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.values import (
    LONGEST_SECONDS,
    FilePath,
    Language,
    Name,
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
