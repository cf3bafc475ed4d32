"""The manifest of a cut: a dub for every stretch of film that it uses.

For a new cut of the same films, dubs that hold its frames stay as they are, so that whatever was
made for them is kept.
"""

import io
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from dubbing.engine.disk.files import atomic_write_text, seen_from
from dubbing.engine.disk.numbered import plain
from dubbing.errors import ManifestError, Problem
from dubbing.manifest.edits import edits_file
from dubbing.manifest.init import HEADER, LONGEST_LEARNT, MOST_SAID, NAME
from dubbing.manifest.keys.edit_entry import LONGEST_NOTE, Edit
from dubbing.manifest.keys.values import check_name
from dubbing.manifest.schema import shipped_uri
from dubbing.media import probe
from dubbing.reels.reel_manifest import SHEET, Ask
from dubbing.timelines import reading, stretch
from dubbing.timelines.films import Films, Shot, files_under
from dubbing.timelines.reading import Event
from dubbing.timelines.speech import FOLDER, Speech
from dubbing.timelines.stretch import Stretch, placed

PREVIOUS = "manifest.previous.yaml"
PERSON = "person"
HANDLES = 8  # frames beside those of a cut that are dubbed, so that it can be trimmed
NOBODY = '{by: "", reference: ""}'


def write_manifest(
    folder: Path,
    timeline: Path,
    handles: int,
    say: Callable[[str], None] = lambda _: None,
    ask: Ask | None = None,
) -> Path:
    """Write ``folder/manifest.yaml`` for a timeline whose films lie in the folder.

    One that was written for an earlier cut gets the dubs of this one; all else in it stays, and the
    last one is kept beside it.

    Args:
        handles: frames to dub before and after those of an event, so that it can be trimmed.
        say: told what is new.
        ask: who is who, where films of a first cut show several people; without, all are one.

    Raises:
        ManifestError: there is a manifest without a timeline, or events without a film.
        ExplainedError: the timeline or a recording cannot be read, or nothing can be written.
    """
    folder, timeline = folder.resolve(), timeline.resolve()
    target = folder / NAME
    before, document = _document(target)
    files = files_under(folder, {folder / FOLDER, folder / str(document.get("output") or "out")})
    films = Films(files, probe)
    events = reading.read(timeline, films.named_in).events
    shots = _shots(events, films, timeline)
    used = list(dict.fromkeys(plain(shot.film.path) for _, shot in shots))
    whose = _identities(document, folder, used, say, ask)
    stretches = list(stretch.read(document, folder))
    last = len(stretches)
    speech = Speech(folder, files, timeline)
    new, other = [], []
    for event, shot in _known_first(shots, stretches, speech):
        holding = [one for one in stretches if one.holds(shot)]
        one = next((one for one in holding if speech.is_of(one, shot, event)), None)
        if one is None:
            one = next((one for one in holding if not one.events), None)
            if one is not None:
                other.append(f"{event}: {one.name}")
            else:
                taken = {one.name for one in stretches}
                one = stretch.new(shot, handles, folder, whose[plain(shot.film.path)], taken)
                stretches.append(one)
                new.append(f"{event}: {one.name}")
                _note(target, one.name, event.notes)
            speech.give(one, shot, event)
        one.events.append(event.number)
    for one in stretches:
        one.entry["events"] = sorted(one.events)
    document["timeline"] = seen_from(folder, timeline)
    document["dubs"] = [one.entry for one in stretches if one.events]
    if before:
        atomic_write_text(folder / PREVIOUS, before)
    atomic_write_text(target, _text(document))
    changes = {
        "left out": [f"{event}: {event.why_not}" for event in events if event.why_not],
        "new": new,
        "other speech": other,
        "not used any more": [one.name for one in stretches[:last] if not one.events],
    }
    say(f"{speech.recording.name} runs along the cut")
    say(f"{len(shots) - len(new)} of {len(events)} events lie in dubs that were there")
    for line in _said(changes):
        say(line)
    return target


def _document(target: Path) -> tuple[str, Any]:
    """The text of the manifest of an earlier cut, and what it holds; '' and a head without one."""
    if not os.path.lexists(target):
        document = _yaml().load(HEADER.format(schema=shipped_uri()))
        document.insert(2, "timeline", "")
        document["defaults"]["on_longer_audio"] = "cut"
        return "", document
    try:
        text = target.read_text(encoding="utf-8")
        document = _yaml().load(text)
        entries = [*(document.get("identities") or {}).values(), *(document.get("dubs") or [])]
    except (OSError, ValueError, AttributeError, YAMLError) as error:
        problem = Problem(0, "", f"cannot be read: {' '.join(str(error).split())[:200]}")
        raise ManifestError(str(target), [problem]) from error
    if not all(isinstance(one, dict) for one in entries):
        raise ManifestError(str(target), [Problem(0, "", "has mistakes: see `dfrf plan`")])
    if not document.get("timeline"):
        problem = Problem(0, "", "it is there already, and is of no timeline; nothing written")
        raise ManifestError(str(target), [problem])
    return text, document


def _shots(events: Sequence[Event], films: Films, timeline: Path) -> list[tuple[Event, Shot]]:
    """The events that can be dubbed, each with its frames.

    Raises:
        ManifestError: there are some without a film.
    """
    found, problems = [], []
    for event in (event for event in events if not event.why_not):
        try:
            found.append((event, films.shot(event)))
        except ValueError as error:
            problems.append(Problem(0, str(event), str(error)))
    if not problems and not found:
        why = events[0].why_not if events else "there is no clip with picture in it"
        problems.append(Problem(0, str(events[0]) if events else "", why))
    if problems:
        raise ManifestError(str(timeline), problems)
    return found


def _identities(
    document: Any, folder: Path, films: list[Path], say: Callable[[str], None], ask: Ask | None
) -> dict[Path, str]:
    """The person of each film, to whom new films are given."""
    people = document.setdefault("identities", CommentedMap())
    if not people and ask is not None:
        people |= _people(folder, films, say, ask)
    if not people:
        people[PERSON] = CommentedMap(clips=[], seconds=LONGEST_LEARNT)
        people[PERSON]["consent"] = _yaml().load(NOBODY)
        say("every film is taken for one of one person: give others identities of their own")
    whose = {
        placed(folder, clip): name
        for name, person in reversed(list(people.items()))
        for clip in person.get("clips") or [person.get("clip")]
    }
    first = next(iter(people))
    for film in (film for film in films if film not in whose):
        if "clips" not in people[first]:
            people[first].insert(0, "clips", [people[first].pop("clip")])
        people[first]["clips"].append(seen_from(folder, film))
        whose[film] = first
        if len(people) > 1:
            say(f"{film.name} is new, and taken for one of {first}")
    return whose


def _people(
    folder: Path, films: list[Path], say: Callable[[str], None], ask: Ask
) -> dict[str, CommentedMap]:
    """People by the names that they are given: each has the films that show them largest.

    Nobody where all films show one person, or none.
    """
    from dubbing.reels.faces import faces_of, write_sheet

    faces = faces_of({seen_from(folder, film): probe(film) for film in films})
    largest: dict[str, Any] = {}
    for face in faces:
        for clip in face.clips:
            other = largest.get(clip)
            if other is None or other.best(clip).sighting.size < face.best(clip).sighting.size:
                largest[clip] = face
    if len({*map(id, largest.values())}) < 2:
        return {}
    write_sheet(faces, folder / SHEET)
    say(f"{folder / SHEET} shows the faces of {len(films)} films")
    found: dict[str, CommentedMap] = {}
    for number, face in enumerate(faces, 1):
        own = [clip for clip in face.clips if largest[clip] is face]
        if not own:
            continue
        say(f"face {number}: {', '.join(own)}")
        name = _name(number, [*found], ask)
        first = face.best(own[0])
        point = CommentedMap(at=round(first.at, 2), x=round(first.x, 3), y=round(first.y, 3))
        found[name] = CommentedMap(clips=own, face=point, seconds=LONGEST_LEARNT)
        found[name]["consent"] = _yaml().load(NOBODY)
    return found


def _name(number: int, taken: list[str], ask: Ask) -> str:
    """The name of a face; asks until it can be one."""
    while True:
        given = ask(f"Who is face {number}? A name").strip() or f"face-{number}"
        try:
            check_name(given)
        except ValueError:
            continue
        if given not in taken:
            return given


def _known_first(
    shots: list[tuple[Event, Shot]], stretches: list[Stretch], speech: Speech
) -> list[tuple[Event, Shot]]:
    """Shots, those first that have a dub with their speech: others may take what is left."""

    def is_new(one: tuple[Event, Shot]) -> bool:
        event, shot = one
        return not any(s.holds(shot) and speech.is_of(s, shot, event) for s in stretches)

    return sorted(shots, key=is_new)


def _note(manifest: Path, name: str, notes: tuple[str, ...]) -> None:
    """Keep the notes of an event where edits of its dub are kept."""
    path = edits_file.edits_file(manifest, name)
    if notes and not path.exists():
        edits_file.write(path, [Edit(note="; ".join(notes)[:LONGEST_NOTE])])


def _said(changes: dict[str, list[str]]) -> Iterator[str]:
    for what, ones in changes.items():
        yield from (f"{what}: {one}" for one in ones[:MOST_SAID])
        if (more := len(ones) - MOST_SAID) > 0:
            yield f"{what}: {more} more, see {NAME}"


def _yaml() -> Any:
    yaml: Any = YAML()
    yaml.width = 10**6  # nothing is folded
    yaml.preserve_quotes = True
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def _text(document: Any) -> str:
    out = io.StringIO()
    _yaml().dump(document, out)
    return out.getvalue()
