"""The manifest of a folder of shots with one script: each shot is dubbed with its own lines."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dubbing.engine.disk.files import atomic_write_text
from dubbing.errors import ExplainedError, ManifestError, Problem
from dubbing.manifest.init import HEADER, LONGEST_LEARNT, Found, clip_of, free_target, sorted_out
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings
from dubbing.manifest.keys.messages import some
from dubbing.manifest.keys.values import as_name, check_name
from dubbing.manifest.keys.yaml_lines import quoted
from dubbing.manifest.scenes.reels import of_film
from dubbing.manifest.schema import shipped_uri
from dubbing.media import MediaInfo
from dubbing.script.line import Line
from dubbing.script.reading import read_lines

if TYPE_CHECKING:
    from dubbing.reels.faces import Face

SHEET = "manifest.faces.jpg"
UNKNOWN = "?"  # stands for a person who is not known yet
PLACE = re.compile(r"\{cue(?::0[0-9])?\}")
NUMBERED = re.compile(r"(.*?)([0-9]+)(\.\w+)")
Ask = Callable[[str], str]


@dataclass(frozen=True)
class Shot:
    """A clip with those lines of the script that are spoken in it; why there are none."""

    info: MediaInfo
    lines: Sequence[Line] = ()
    why_not: str = ""

    @property
    def speakers(self) -> list[str]:
        """Names in its lines, each once."""
        return list(dict.fromkeys(line.speaker for line in self.lines if line.speaker))


def write_manifest(folder: Path, say: Callable[[str], None], ask: Ask | None = None) -> Path | None:
    """Write ``folder/manifest.yaml`` where a folder holds several clips and one script for them.

    Beside it lies a sheet of the faces in the clips. Whoever is asked says which of them is which
    speaker; where nobody is, the manifest has people by the numbers of their faces, and speakers
    without a person, which `dfrf plan` names.

    Returns:
        None where the folder holds something else.

    Raises:
        ManifestError: there is a manifest already.
        ExplainedError: the script cannot be read, or nothing can be written there.
    """
    found = sorted_out(folder)
    if len(found.scripts) != 1 or len(found.clips) < 2:
        return None
    (script,) = found.scripts
    if clip_of(script.stem, found.clips):
        return None
    target = free_target(folder)
    from dubbing.reels.faces import faces_of, write_sheet

    shots = {name: _shot(script, info) for name, info in found.clips.items()}
    speakers = list(dict.fromkeys(name for shot in shots.values() for name in shot.speakers))
    if not speakers:
        why = next((shot.why_not for shot in shots.values() if shot.why_not), "it names nobody")
        raise ManifestError(
            str(target), [Problem(0, "", f"no shot has lines of {script.name}: {why}")]
        )
    faces = faces_of(found.clips)
    if not faces:
        raise ManifestError(str(target), [Problem(0, "", f"no clip in {folder} shows a face")])
    write_sheet(faces, folder / SHEET)
    for one in found.unused:
        say(f"left out: {one}")
    say(f"{folder / SHEET} shows the faces of {len(found.clips)} clips")
    for number, face in enumerate(faces, 1):
        say(f"face {number}: {', '.join(found.clips[clip].path.name for clip in face.clips)}")
    whose = {name: asked(name, len(faces), ask) if ask else [] for name in speakers}
    people = _names(whose, len(faces), known=ask is not None)
    lines = [HEADER.format(schema=shipped_uri()) + f"# {SHEET} shows the faces by their numbers."]
    lines += ["identities:"]
    for number, name in people.items():
        lines += _identity(name, number, faces[number - 1], found)
    lines += ["dubs:"]
    for clip, shot in shots.items():
        seen = {n: people[n] for n in people if clip in faces[n - 1].clips}
        lines += _dub(
            clip, shot, script, found, {s: [seen[n] for n in whose[s] if n in seen] for s in whose}
        )
    atomic_write_text(target, "\n".join(lines) + "\n")
    used = [_files(_sound(clip, shot, found)) for clip, shot in shots.items()]
    names = [path.name for path in found.recordings]
    if left := [name for name in names if not any(one.fullmatch(name) for one in used)]:
        say(f"not used are {some(left)}, as of another language: copy the dubs for them")
    return target


def _files(sound: str) -> re.Pattern[str]:
    """Names of the recordings that `_sound` gives."""
    return re.compile("[0-9]+".join(map(re.escape, PLACE.split(sound))))


def asked(speaker: str, count: int, ask: Ask) -> list[int]:
    """The numbers of the faces of a speaker; asks until they are some of so many, or nothing."""
    while True:
        answer = ask(f"Which face is {speaker}? Numbers as 1 or 1, 3; nothing for nobody").strip()
        parts = [part.strip() for part in answer.split(",")] if answer else []
        if all(part.isdecimal() and 1 <= int(part) <= count for part in parts):
            return list(dict.fromkeys(map(int, parts)))


def _shot(script: Path, info: MediaInfo) -> Shot:
    """The lines of a reel's script that a clip's timecodes give it."""
    try:
        every = read_lines(script, info.timecode_rate, None)
    except ExplainedError as error:
        raise ExplainedError(str(error), str(script)) from error
    findings = Findings()
    dealt = of_film(
        findings, (), Dub.model_construct(name="", lines=script, reel_start=None), info, every
    )
    if not dealt.reel:
        return Shot(info, why_not="it has no timecode in the script's times: fill in reel_start")
    why = "; ".join(message for _, message in findings.problems)
    return Shot(info, [] if why else dealt.lines, why)


def _names(whose: Mapping[str, list[int]], count: int, *, known: bool) -> dict[int, str]:
    """Names of identities by the numbers of their faces."""
    if not known:
        return {number: f"face-{number}" for number in range(1, count + 1)}
    found: dict[int, str] = {}
    for speaker, numbers in whose.items():
        for number in numbers:
            name = speaker.lower() if number == numbers[0] else f"{speaker.lower()}-{number}"
            try:
                check_name(name)
            except ValueError:
                name = f"face-{number}"
            found.setdefault(number, f"face-{number}" if name in found.values() else name)
    return found


def _identity(name: str, number: int, face: "Face", found: Found) -> list[str]:
    first = face.best(face.clips[0])
    clips = ", ".join(quoted(found.clips[clip].path.name) for clip in face.clips)
    return [
        f"  {quoted(name)}:  # face {number}",
        f"    clips: [{clips}]",
        f"    face: {{at: {first.at:.2f}, x: {first.x:.3f}, y: {first.y:.3f}}}",
        f"    seconds: {LONGEST_LEARNT}",
        '    consent: {by: "", reference: ""}',
    ]


def _dub(
    clip: str, shot: Shot, script: Path, found: Found, whose: Mapping[str, list[str]]
) -> list[str]:
    """The dub of a shot, as a comment where something is missing.

    Args:
        whose: by speaker, their identities that the shot shows.
    """
    name, film = as_name(f"{clip}_{script.stem}"), shot.info.path.name
    if not shot.lines:
        return [f"  # {film}: {shot.why_not}"]
    known = any(whose.values())
    speakers = {s: (whose[s] or [UNKNOWN])[0] for s in shot.speakers if whose[s] or not known}
    unseen = [s for s in shot.speakers if s not in speakers]
    sound, keys = _sound(clip, shot, found), [f"name: {quoted(name)}", f"clip: {quoted(film)}"]
    given = ", ".join(f"{quoted(s)}: {quoted(who)}" for s, who in speakers.items())
    keys += [f"lines: {quoted(script.name)}", f"speakers: {{{given}}}"]
    keys += [f"audio: {quoted(sound)}"] if sound else []
    why = [] if sound else ["fill in audio, as long as the shot, or one for each line"]
    why += [f"{', '.join(unseen)}: not seen in it"] if unseen else []
    entry = f"  - {{{', '.join(keys)}}}" + (f"  # {'; '.join(why)}" if why else "")
    return [entry if sound and speakers else f"  #{entry[1:]}"]


def _sound(clip: str, shot: Shot, found: Found) -> str:
    """The recordings of a shot's lines, by their numbers, or one that is called as the shot."""
    files = {path.name for path in found.recordings}
    for first in sorted(files):
        if match := NUMBERED.fullmatch(first):
            before, digits, suffix = match.groups()
            width = len(digits) if digits[0] == "0" else 1
            wanted = {
                f"{before}{line.number:0{width}}{suffix}" for line in shot.lines if line.speaker
            }
            if wanted <= files:
                cue = f"{{cue:0{width}}}" if width > 1 else "{cue}"
                return f"{before}{cue}{suffix}"
    return next((p.name for p in found.recordings if clip_of(p.stem, found.clips) == clip), "")
