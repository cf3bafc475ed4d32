"""A first manifest from the clips, recordings and scripts of a folder."""

import mimetypes
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from dubbing.engine.disk.files import atomic_write_text, make_folder, same_on_disk
from dubbing.errors import ExplainedError, ManifestError, MediaError, Problem
from dubbing.manifest.keys.values import as_name
from dubbing.manifest.keys.yaml_lines import quoted
from dubbing.manifest.schema import shipped_uri
from dubbing.media import MediaInfo, probe
from dubbing.script.reading import READERS, read_lines, why_no_script

NAME = "manifest.yaml"
LONGEST_LEARNT = 15  # seconds
MOST_SAID = 20  # sentences of what was paired
NAMED = "its name begins with the clip's"
ONLY = "there is no other clip, and no other recording"
HEADER = """\
# yaml-language-server: $schema={schema}
# Written by `dfrf init`. Fill in who agreed to be dubbed and where that is written down, delete
# what you do not want, then run `dfrf plan` on this file. Every path is relative to it.
version: 1
output: out
defaults: {{preset: fast, seed: 0}}
"""


def write_manifest(folder: Path, say: Callable[[str], None] = lambda _: None) -> Path:
    """Write ``folder/manifest.yaml``; an existing one is left alone.

    Every recording is dubbed onto one clip at most, see `clip_of`; every script makes a scene of
    its clip, see `_scene`. What fits no clip, or is no clip to learn from, becomes a comment. One
    clip and one recording are a pair, whatever they are called.

    Args:
        say: told what was paired with what, and why.

    Raises:
        ManifestError: there is a manifest already, or nothing to write one from.
        ExplainedError: nothing can be written there.
    """
    target = free_target(folder)
    found = sorted_out(folder)
    if not found.clips:
        why = [f"no clip with sound in {folder}", *found.left_out]
        raise ManifestError(str(target), [Problem(0, "", "; ".join(why))])
    header = HEADER.format(schema=shipped_uri())
    lines = [header + "identities:", *_identities(found), *_dubs(found)]
    atomic_write_text(target, "\n".join(lines) + "\n")
    for one in found.unused[:MOST_SAID]:
        say(f"left out: {one}")
    for pair in found.paired[:MOST_SAID]:
        say(pair)
    if (more := len(found.paired) - MOST_SAID) > 0:
        say(f"and {more} more, see {NAME}")
    return target


def clip_of(recording: str, clips: Iterable[str]) -> str | None:
    """The clip that a recording is meant for, by their names; None where there is none.

    The recording is called as the clip, or begins with its name and a character that is neither
    letter nor digit: ``shot1_it`` belongs to ``shot1``, not to ``shot10`` or ``shot``. Of several
    that fit it is the longest. Case does not matter.
    """
    name = same_on_disk(recording)
    keys = {clip: same_on_disk(clip) for clip in clips}
    fitting = [
        c for c, k in keys.items() if name.startswith(k) and not name[len(k) :][:1].isalnum()
    ]
    return max(fitting, key=len, default=None)


@dataclass
class Found:
    """Clips of a folder with picture and sound by name; recordings; why videos are left out.

    ``no_scripts``: why files with the endings of scripts are left out. ``paired``: what was put
    together, in words.
    """

    clips: dict[str, MediaInfo] = field(default_factory=dict)
    recordings: list[Path] = field(default_factory=list)
    scripts: list[Path] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    no_scripts: list[str] = field(default_factory=list)
    paired: list[str] = field(default_factory=list)

    @property
    def unused(self) -> list[str]:
        """Why files are left out, in words."""
        return self.left_out + self.no_scripts

    def pair(self, sound: Path, clip: str, why: str) -> None:
        """Note that a recording or script belongs to a clip."""
        self.paired.append(f"{sound.name} is for {self.clips[clip].path.name}: {why}")


def _identities(found: Found) -> list[str]:
    lines = []
    for name, info in found.clips.items():
        seconds = min(LONGEST_LEARNT, int(0.75 * info.duration) or 1)
        about = f"{info.duration:.1f} s, {info.width}x{info.height}"
        lines += [
            f"  {quoted(as_name(name))}:",
            f"    clip: {quoted(info.path.name)}  # {about}",
            f"    seconds: {seconds}",
            '    consent: {by: "", reference: ""}',
        ]
    return lines + [f"  # left out: {why}" for why in found.unused]


def _dubs(found: Found) -> list[str]:
    if not found.recordings:
        found.paired.append("no recording was found, so there is nothing to dub yet")
        return ["dubs: []  # no recordings were found"]
    only = next(iter(found.clips)) if len(found.clips) == 1 else ""
    # One clip and one recording can only be a pair; unless a name says otherwise.
    pair = (
        len(found.recordings) == 1
        and not found.left_out
        and clip_of(found.recordings[0].stem, found.clips) is None
    )
    matched: list[str] = []
    unmatched: list[str] = []
    for script in found.scripts:
        scene, why = _scene(script, found, pair=pair)
        (unmatched if why else matched).append(f"- {{{', '.join(scene)}}}{why}")
    stems = Counter(same_on_disk(recording.stem) for recording in found.recordings)
    for recording in found.recordings:
        clip = clip_of(recording.stem, found.clips)
        keys = f"identity: {quoted(as_name(clip or only))}, audio: {quoted(recording.name)}"
        if clip is None and only and pair:
            found.pair(recording, only, ONLY)
            matched.append(f"- {{{keys}}}  # {ONLY}")
        elif clip is None:
            found.paired.append(f"{recording.name} is for nobody: its name begins with no clip's")
            unmatched.append(f"- {{{keys}}}")
        else:
            found.pair(recording, clip, NAMED)
            # The clip's name would stand twice in the default one.
            name = recording.stem if stems[same_on_disk(recording.stem)] == 1 else recording.name
            matched.append(f"- {{name: {quoted(as_name(name))}, {keys}}}")
    lines = ["dubs:", *(f"  {entry}" for entry in matched)]
    if unmatched:
        lines += ["  # These begin with no clip's name and a separator, or something is missing."]
        lines += [f"  # {entry}" for entry in unmatched]
    return lines


def _scene(script: Path, found: Found, *, pair: bool) -> tuple[list[str], str]:
    """Keys of the scene that a script makes, and in words what is missing.

    The script is named as the clip, or begins with its name. Its sound is the recording of the same
    name, which makes no dub of its own then, or one a speaker: ``shot1_it_HOST`` beside
    ``shot1_it.srt``. The clip's person is the only speaker, or the one of that name. A clip, a
    recording and a script that are alone belong together, whatever they are called (``pair``).
    """
    clip = clip_of(script.stem, found.clips)
    alone = pair and len(found.clips) == len(found.scripts) == 1
    if clip is None and alone:
        clip = next(iter(found.clips))
    keys = [f"name: {quoted(as_name(script.stem))}", f"lines: {quoted(script.name)}"]
    if clip is None:
        return keys, "  # fits no clip: fill in identity and audio"
    info = found.clips[clip]
    try:
        lines = read_lines(script, info.rate or Fraction(25), None)
    except ExplainedError as error:
        return keys, f"  # {' '.join(str(error).split())}"
    names = list(dict.fromkeys(line.speaker for line in lines))
    own = names if len(names) == 1 else [n for n in names if same_on_disk(n) == same_on_disk(clip)]
    speaker = next(iter(own), "")
    if not speaker and len(names) > 1:
        there = ", ".join(map(quoted, names))
        return keys, f"  # fill in identity, or speakers; there are {there}"
    who = f"speakers: {{{quoted(speaker)}: {quoted(as_name(clip))}}}"
    keys.append(who if speaker else f"identity: {quoted(as_name(clip))}")
    stems = {same_on_disk(script.stem + end) for end in ("", f"_{speaker}" if speaker else "")}
    sound = next((r for r in found.recordings if alone or same_on_disk(r.stem) in stems), None)
    if sound is None:
        return keys, f"  # no recording is called {quoted(script.stem)}: fill in audio"
    found.recordings.remove(sound)
    why = ONLY if alone else NAMED
    found.pair(script, clip, why)
    found.pair(sound, clip, why)
    return [*keys, f"audio: {quoted(sound.name)}"], ""


def free_target(folder: Path) -> Path:
    """The manifest to write into a folder, which is made if need be.

    Raises:
        ManifestError: there is one already.
    """
    make_folder(folder)
    target = folder / NAME
    if target.exists():
        raise ManifestError(str(target), [Problem(0, "", "it is there already; nothing written")])
    return target


def sorted_out(folder: Path) -> Found:
    """Sort the files of a folder into clips, recordings and scripts."""
    found = Found()
    taken: dict[str, str] = {}
    # macOS keeps `._host.mp4` beside `host.mp4` on disks of other systems.
    for path in sorted(path for path in folder.iterdir() if not path.name.startswith(".")):
        if path.suffix.lower() in READERS:
            if why := why_no_script(path):
                found.no_scripts.append(f"{quoted(path.name)}: {why}")
            else:
                found.scripts.append(path)
            continue
        try:
            info = probe(path)
        except MediaError as error:
            if (mimetypes.guess_type(path.name)[0] or "").startswith(("audio/", "video/")):
                found.left_out.append(f"{quoted(path.name)}: {error.what}")
            continue  # else it is no media
        if info.picture is None:
            if info.audio_rate is not None:
                found.recordings.append(path)
        elif info.frames > 1 and info.audio_rate is None:
            found.left_out.append(f"{quoted(path.name)} has no sound to learn from")
        elif info.frames > 1:
            other = taken.setdefault(same_on_disk(path.stem), path.name)
            if other == path.name:
                found.clips[path.stem] = info
            else:
                found.left_out.append(f"{quoted(path.name)} has the name of {quoted(other)}")
    return found
