"""The marks of origin that a file carries: metadata, credentials, the invisible mark."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av

from dubbing import media
from dubbing.errors import ExplainedError, MediaError
from dubbing.media.opening.opening import opened
from dubbing.packages import lacking, missing_of
from dubbing.provenance import credentials, mark_search
from dubbing.provenance.mark_key import fingerprint_of, id_of, read_key
from dubbing.provenance.provenance import statements


@dataclass(frozen=True)
class Verified:
    """The marks of origin found in one file.

    Attributes:
        credentials: the signed ones; None where there are none, or none that can be read.
        credentials_note: why they were not looked for, or cannot be read; else empty.
        broken: whether there are credentials that do not hold: the file was changed since.
        marks: of every key that was tried, by its fingerprint.
        metadata: tags that say so; empty where there are none.
    """

    credentials: credentials.Credentials | None
    credentials_note: str
    broken: bool
    marks: dict[str, mark_search.MarkResult]
    metadata: dict[str, str]

    @property
    def found(self) -> bool:
        """Whether the file carries a mark of origin that is valid.

        Where credentials are broken, nothing beside them is trusted either.
        """
        if self.broken:
            return False
        marked = any(mark.present for mark in self.marks.values())
        return self.credentials is not None or bool(self.metadata) or marked

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "found": self.found,
            "credentials": vars(self.credentials) if self.credentials else None,
            "credentials_note": self.credentials_note,
            "credentials_broken": self.broken,
            "marks": [
                {
                    "key": key,
                    "present": mark.present,
                    "id": id_of(mark.bits) if mark.present else None,
                    "weakest_bit": round(float(mark.sureness.min()), 2),
                    "statistic": round(mark.statistic, 1),
                    "threshold": round(mark.threshold, 1),
                    "scale": round(mark.scale, 3),
                    "frames": mark.frames,
                }
                for key, mark in self.marks.items()
            ],
            "metadata": self.metadata,
        }


def verify(video: Path, keys: Sequence[Path]) -> Verified:
    """Search a file for every mark of origin that a dub may carry.

    Args:
        keys: files of keys of the invisible mark.

    Raises:
        MediaError: it is no video, or it breaks off.
        ExplainedError: a key cannot be read.
    """
    secrets = [read_key(file) for file in keys]
    info = media.probe(video)
    if info.picture is None:
        raise MediaError("no picture in it", str(video), "name a video")
    results = []
    if secrets:
        frames = media.read_frames(video, pixels="gray")
        results = mark_search.search(frames, info.rate, secrets)
    marks = {fingerprint_of(key): mark for key, mark in zip(secrets, results, strict=True)}
    signed, note, broken = _credentials(video)
    return Verified(signed, note, broken, marks, _metadata(video))


def _credentials(video: Path) -> tuple[credentials.Credentials | None, str, bool]:
    if gone := missing_of("c2pa"):
        return None, str(lacking(gone)), False
    try:
        signed = credentials.read(video)
    except ExplainedError as error:
        return None, str(error), True
    return signed, "", signed is not None and signed.state == "Invalid"


def _metadata(video: Path) -> dict[str, str]:
    try:
        with opened(video) as container:
            tags = {key.lower(): value for key, value in container.metadata.items()}
    except av.FFmpegError as error:
        raise MediaError(f"cannot be read: {error}", str(video)) from error
    return statements(tags)


def sentences(verified: Verified) -> list[str]:
    """Lines of text that tell people what marks of origin a file carries."""
    signed = verified.credentials
    if signed is None:
        lines = [f"credentials: none{f' ({note})' if (note := verified.credentials_note) else ''}"]
    else:
        lines = [f"credentials: {signed.state}, signed by {signed.signed_by or 'nobody named'}"]
        lines.append(f"  actions: {', '.join(signed.actions) or 'nothing'}")
        lines += [f"  {name}: {value}" for name, value in signed.dub.items()]
        lines += [f"  problem: {problem}" for problem in signed.problems]
        lines += [f"  problem of the film it was made of: {p}" for p in signed.film_problems]
        if signed.earlier:
            lines.append(f"  with {signed.earlier} earlier credentials of what went into it")
    for key, mark in verified.marks.items():
        if mark.present:
            sure = f"weakest bit {mark.sureness.min():.1f} deviations"
            lines.append(f"invisible mark: {id_of(mark.bits)} (key {key}, {sure})")
        else:
            lines.append(f"invisible mark: none of key {key}")
    if not verified.marks:
        lines.append("invisible mark: not looked for, there is no key here; name one with --key")
    said = next(iter(verified.metadata.values()), "nothing that says so of its picture")
    lines.append(f"metadata: {said}")
    if verified.broken:
        lines.append("its credentials do not hold: the file was changed after it was signed, or")
        lines[-1] += " they were torn; what else it carries is no proof. Ask for the file as signed"
    return lines
