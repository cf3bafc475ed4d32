"""A first manifest from the clips and recordings of a folder."""

from __future__ import annotations

import json
from pathlib import Path

from dubbing.errors import ManifestError, MediaError, Problem
from dubbing.files import atomic_write_text, make_folder
from dubbing.media.probing import MediaInfo, probe

NAME = "manifest.yaml"
LONGEST_LEARNT = 15  # seconds
HEADER = """\
# Written by `dfrf init`. Fill in who agreed to be dubbed and where that is written down, delete
# what you do not want, then run `dfrf plan` on this file. Every path is relative to it.
version: 1
output: out
defaults: {preset: fast, seed: 0}
"""


def write_manifest(folder: Path) -> Path:
    """Write ``folder/manifest.yaml``; an existing one is left alone.

    Every recording is dubbed onto the clip whose name its own name begins with, or else onto
    every clip.

    Raises:
        ManifestError: there is a manifest already, or nothing to write one from.
        DubbingError: nothing can be written there.
    """
    make_folder(folder)
    target = folder / NAME
    if target.exists():
        raise ManifestError(str(target), [Problem(0, "", "it is there already; nothing written")])
    clips, recordings = _sort(folder)
    if not clips:
        raise ManifestError(str(target), [Problem(0, "", f"no clip with sound in {folder}")])
    lines = [HEADER + "identities:"]
    for name, info in clips.items():
        seconds = min(LONGEST_LEARNT, int(0.75 * info.duration) or 1)
        about = f"{info.duration:.1f} s, {info.width}x{info.height}"
        lines += [
            f"  {_quoted(name)}:",
            f"    clip: {_quoted(info.path.name)}  # {about}",
            f"    seconds: {seconds}",
            '    consent: {by: "", reference: ""}',
        ]
    dubs = [
        f"  - {{identity: {_quoted(clip)}, audio: {_quoted(recording.name)}}}"
        for recording in recordings
        for clip in ([c for c in clips if recording.stem.startswith(c)] or clips)
    ]
    lines += ["dubs:", *dubs] if dubs else ["dubs: []  # no recordings were found"]
    atomic_write_text(target, "\n".join(lines) + "\n")
    return target


def _sort(folder: Path) -> tuple[dict[str, MediaInfo], list[Path]]:
    """Clips with picture and sound by name, and recordings without a picture."""
    clips: dict[str, MediaInfo] = {}
    recordings: list[Path] = []
    for path in sorted(folder.iterdir()):
        try:
            info = probe(path)
        except MediaError:
            continue  # not media
        if info.rate is not None and info.audio_rate is not None and info.frames > 1:
            clips.setdefault(path.stem, info)
        elif info.audio_rate is not None and info.rate is None:
            recordings.append(path)
    return clips, recordings


def _quoted(text: str) -> str:
    """A string YAML reads back as it is: JSON's strings are YAML's."""
    return json.dumps(text, ensure_ascii=False)
