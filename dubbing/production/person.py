"""A person of a production: their clips, their consent, and the settings of their model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dubbing.engine.disk.file_digests import sha256_of
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.production.clip import Clip, PersonClip

FULL_SIZE = 512  # px of a head crop whose work counts as one
HEAD_SHARE = 0.6  # of a film's height that a head crop often has; a square film shows a head alone
MOST_OF_NAME = 200  # bytes of a clip's name in that of its part


@dataclass(frozen=True)
class Consent:
    """The terms of an agreement, and the files that prove it.

    Attributes:
        terms: all of them, as plain data.
        files: by the key that the SHA-256 of each has in a record.
    """

    terms: Mapping[str, Any]
    files: Mapping[str, Path]

    def record(self) -> dict[str, Any]:
        """The terms, and the SHA-256 of the files, as results record them."""
        return {**self.terms, **{key: sha256_of(path) for key, path in self.files.items()}}

    def signed_record(self) -> dict[str, Any]:
        """The part of the record that signed credentials hold."""
        record = self.record()
        return {k: record[k] for k in ("reference", "sha256", "file_sha256") if k in record}


@dataclass(frozen=True)
class Person:
    """A filmed person.

    Attributes:
        clips: all clips, each once; dubs can be made over any of them.
        learned: the clips that the model is learned from, the main one first.
        start: second of the main clip where the learned seconds begin; None for the best seconds.
        seconds: learned from, all clips together.
        size: most px of the head crop's side.
        settings: of the fine-tune.
        speech_files: all weights that turn speech into features and lips, by name.
        base: checkpoint that the fine-tune starts from; None for random weights.
        own_base, own_iterations: whether the manifest names them.
    """

    name: str
    clips: tuple[PersonClip, ...]
    learned: tuple[PersonClip, ...]
    consent: Consent
    start: float | None
    seconds: float
    size: int
    settings: FinetuneSettings
    speech_files: Mapping[str, Path]
    base: Path | None = None
    own_base: bool = False
    own_iterations: bool = False

    @property
    def clip(self) -> PersonClip:
        """The main clip."""
        return self.learned[0]

    def clip_at(self, path: Path) -> PersonClip:
        """The clip of this person that is a certain file."""
        return next(clip for clip in (*self.learned, *self.clips) if clip.path == path)

    def for_dubs(self) -> Person:
        """The same, learned from parts of clips that are long; the best seconds are of all."""
        if (start := self.start) is None:
            return self
        parts = tuple(clip.part_with(start, start + self.seconds) for clip in self.learned)
        return replace(self, learned=parts)

    def learned_minutes(self) -> list[str]:
        """The part of a long clip that is learned from for dubs, in words."""
        return [
            f"identities.{self.name}: of {clip.path.name} learned from {first // 60}:00 to "
            f"{-(-stop // 60)}:00 alone, turned heads included; `start` chooses other minutes"
            for clip in self.for_dubs().learned
            if clip.part is not None
            for first, stop in [clip.used_seconds]
        ]

    def named(self, film: PersonClip) -> PersonClip:
        """A film under which is dubbed, with a name that no other part of the file has."""
        learned = [clip for clip in self.for_dubs().learned if clip.path == film.path]
        if film in learned or (film.part is None and not learned):
            return film
        first, stop = film.used_seconds
        stem = (film.name or film.path.stem).encode()[:MOST_OF_NAME].decode(errors="ignore")
        return replace(film, name=f"{stem}@{first}-{stop}s")

    @property
    def learned_frames(self) -> float:
        """Frames that the model is learned from, as far as the clips have them."""
        frames = sum(clip.frames for clip in self.learned)
        return min(frames, self.seconds * float(self.clip.rate)) if self.clip.info else 0.0

    def crops(self, clip: Clip) -> float:
        """Area of the head crop in a clip, in crops of `FULL_SIZE`, as far as it is known."""
        if clip.info is None:
            return 0.0
        width, height = clip.info.width, clip.info.height
        share = 1 if width == height else HEAD_SHARE
        return (min(self.size, share * min(width, height)) / FULL_SIZE) ** 2
