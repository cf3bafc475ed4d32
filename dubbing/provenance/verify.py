"""The marks of origin that a file carries: metadata, credentials, the invisible mark."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av

from dubbing import media
from dubbing.errors import DubbingError, MediaError
from dubbing.media.opening import opened
from dubbing.packages import lacking, missing_of
from dubbing.provenance import credentials, mark_search
from dubbing.provenance.mark_key import fingerprint_of, id_of, read_key

MOST_FRAMES = 100  # that are searched for the mark
PIECES = 4  # places of the film that they are taken from
TAG = "AI-generated"  # in the metadata of what this tool makes
KEYS = ("comment", "description", "encoder")


@dataclass(frozen=True)
class Verified:
    """What was found in one file.

    Attributes:
        credentials: what is signed; None where there is nothing, or nothing that can be read.
        credentials_note: why they were not looked for, or cannot be read; else empty.
        marks: of every key that was tried, by its fingerprint.
        metadata: tags that speak of generation; empty where there are none.
    """

    credentials: credentials.Found | None
    credentials_note: str
    marks: dict[str, mark_search.Found]
    metadata: dict[str, str]

    @property
    def found(self) -> bool:
        """Whether the file carries anything that holds."""
        signed = self.credentials is not None and self.credentials.state != "Invalid"
        return signed or bool(self.metadata) or any(seen.present for seen in self.marks.values())

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "found": self.found,
            "credentials": vars(self.credentials) if self.credentials else None,
            "credentials_note": self.credentials_note,
            "marks": [
                {
                    "key": key,
                    "present": seen.present,
                    "id": id_of(seen.bits) if seen.present else None,
                    "weakest_bit": round(float(seen.sureness.min()), 2),
                    "statistic": round(seen.statistic, 1),
                    "threshold": round(seen.threshold, 1),
                    "scale": round(seen.scale, 3),
                    "frames": seen.frames,
                }
                for key, seen in self.marks.items()
            ],
            "metadata": self.metadata,
        }


def verify(video: Path, keys: Sequence[Path]) -> Verified:
    """Look for everything a dub may carry.

    Args:
        keys: files of keys of the invisible mark.

    Raises:
        MediaError: it is no video, or it breaks off.
        DubbingError: a key cannot be read.
    """
    secrets = [read_key(file) for file in keys]
    info = media.probe(video)
    if info.picture is None:
        raise MediaError("no picture in it", str(video), "name a video")
    total, count = mark_search.summed(_pieces(video, info)) if secrets else (None, 0)
    marks = {
        fingerprint_of(key): mark_search.search(total, count, key)
        for key in secrets
        if total is not None
    }
    signed, note = _credentials(video)
    return Verified(signed, note, marks, _metadata(video))


def _pieces(video: Path, info: media.MediaInfo) -> Any:
    """Luma of frames from several places: faces may be anywhere in a film."""
    each = MOST_FRAMES // PIECES
    if info.frames <= MOST_FRAMES:
        yield from media.read_frames(video, pixels="gray")
        return
    for k in range(PIECES):
        start = k * (info.frames - each) // (PIECES - 1)
        yield from media.read_frames(video, start=start, count=each, pixels="gray")


def _credentials(video: Path) -> tuple[credentials.Found | None, str]:
    if gone := missing_of("c2pa"):
        return None, str(lacking(gone))
    try:
        return credentials.read(video), ""
    except DubbingError as error:
        return None, str(error)


def _metadata(video: Path) -> dict[str, str]:
    try:
        with opened(video) as container:
            tags = {key.lower(): value for key, value in container.metadata.items()}
    except av.FFmpegError as error:
        raise MediaError(f"cannot be read: {error}", str(video)) from error
    if not any(TAG in value for value in tags.values()):
        return {}
    return {key: tags[key] for key in KEYS if key in tags}


def sentences(found: Verified) -> list[str]:
    """What was found, for people."""
    signed = found.credentials
    if signed is None:
        lines = [f"credentials: none{f' ({note})' if (note := found.credentials_note) else ''}"]
    else:
        lines = [f"credentials: {signed.state}, signed by {signed.signed_by or 'nobody named'}"]
        lines.append(f"  actions: {', '.join(signed.actions) or 'nothing'}")
        lines += [f"  {name}: {value}" for name, value in signed.dub.items()]
        lines += [f"  problem: {problem}" for problem in signed.problems]
        if signed.earlier:
            lines.append(f"  with {signed.earlier} earlier credentials of what went into it")
    for key, seen in found.marks.items():
        if seen.present:
            sure = f"weakest bit {seen.sureness.min():.1f} deviations"
            lines.append(f"invisible mark: {id_of(seen.bits)} (key {key}, {sure})")
        else:
            lines.append(f"invisible mark: none of key {key}")
    if not found.marks:
        lines.append("invisible mark: not looked for, there is no key here; name one with --key")
    lines.append(f"metadata: {found.metadata.get('comment', 'nothing of an AI-generated picture')}")
    return lines
