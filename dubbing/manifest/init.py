"""A first manifest from the clips and recordings of a folder."""

import json
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from dubbing.errors import ManifestError, MediaError, Problem
from dubbing.files import atomic_write_text, make_folder
from dubbing.media import MediaInfo, probe

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

    Every recording is dubbed onto one clip at most, see `clip_of`. What fits no clip, or is no
    clip to learn from, becomes a comment.

    Raises:
        ManifestError: there is a manifest already, or nothing to write one from.
        DubbingError: nothing can be written there.
    """
    make_folder(folder)
    target = folder / NAME
    if target.exists():
        raise ManifestError(str(target), [Problem(0, "", "it is there already; nothing written")])
    found = _sort(folder)
    if not found.clips:
        raise ManifestError(str(target), [Problem(0, "", f"no clip with sound in {folder}")])
    atomic_write_text(
        target, "\n".join([HEADER + "identities:", *_identities(found), *_dubs(found)]) + "\n"
    )
    return target


def clip_of(recording: str, clips: Iterable[str]) -> str | None:
    """The clip that a recording is meant for, by their names; None where there is none.

    The recording is called as the clip, or begins with its name and a character that is neither
    letter nor digit: ``shot1_it`` belongs to ``shot1``, not to ``shot10`` or ``shot``. Of several
    that fit it is the longest. Case does not matter.
    """
    name = _key(recording)
    fitting = [
        c for c in clips if name.startswith(_key(c)) and not name[len(_key(c)) :][:1].isalnum()
    ]
    return max(fitting, key=len, default=None)


@dataclass
class _Found:
    """Clips with picture and sound by name, recordings, and why other videos are left out."""

    clips: dict[str, MediaInfo] = field(default_factory=dict)
    recordings: list[Path] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def _identities(found: _Found) -> list[str]:
    lines = []
    for name, info in found.clips.items():
        seconds = min(LONGEST_LEARNT, int(0.75 * info.duration) or 1)
        about = f"{info.duration:.1f} s, {info.width}x{info.height}"
        lines += [
            f"  {_quoted(name)}:",
            f"    clip: {_quoted(info.path.name)}  # {about}",
            f"    seconds: {seconds}",
            '    consent: {by: "", reference: ""}',
        ]
    return lines + [f"  # left out: {why}" for why in found.left_out]


def _dubs(found: _Found) -> list[str]:
    if not found.recordings:
        return ["dubs: []  # no recordings were found"]
    matched: list[str] = []
    unmatched: list[str] = []
    only = next(iter(found.clips)) if len(found.clips) == 1 else ""
    for recording in found.recordings:
        clip = clip_of(recording.stem, found.clips)
        keys = f"identity: {_quoted(clip or only)}, audio: {_quoted(recording.name)}"
        if clip is None:
            unmatched.append(f"- {{{keys}}}")
        else:  # the clip's name would stand twice in the default one
            matched.append(f"- {{name: {_quoted(recording.stem)}, {keys}}}")
    lines = ["dubs:", *(f"  {entry}" for entry in matched)]
    if unmatched:
        lines += ["  # These begin with no clip's name and a separator: fill in the identity."]
        lines += [f"  # {entry}" for entry in unmatched]
    return lines


def _sort(folder: Path) -> _Found:
    found = _Found()
    taken: dict[str, str] = {}
    for path in sorted(folder.iterdir()):
        try:
            info = probe(path)
        except MediaError:
            continue  # not media
        if info.picture is None:
            if info.audio_rate is not None:
                found.recordings.append(path)
        elif info.frames > 1 and info.audio_rate is None:
            found.left_out.append(f"{_quoted(path.name)} has no sound to learn from")
        elif info.frames > 1:
            other = taken.setdefault(_key(path.stem), path.name)
            if other == path.name:
                found.clips[path.stem] = info
            else:
                why = f"{_quoted(path.name)} has the name of {_quoted(other)}"
                found.left_out.append(why)
    return found


def _key(name: str) -> str:
    """A name as names are compared: file systems write accents in two ways."""
    return unicodedata.normalize("NFC", name).casefold()


def _quoted(text: str) -> str:
    """A string YAML reads back as it is: JSON's strings are YAML's."""
    return json.dumps(text, ensure_ascii=False)
