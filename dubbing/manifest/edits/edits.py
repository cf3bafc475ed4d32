"""The edits of a dub: which of its lines each is of, and what is wrong with them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from dubbing.errors import ExplainedError
from dubbing.face.mouth.lip_curves import LipCurves
from dubbing.manifest.keys import edit_entry
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.messages import some, suggestion
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue

NO_LIPS = dict.fromkeys(("paper", "ad-nerf", "nerf"), "has no lip measures")
NO_SPEECH = {"nerf": "hears no speech"}
# Presets whose models have nothing that a key could change, and why.
WITHOUT = {
    **dict.fromkeys(("strength", "style", "keys", "curves"), NO_LIPS),
    **dict.fromkeys(("shift", "moved"), NO_SPEECH),
}


def edited(
    findings: Findings, at: KeyPath, dub: Dub, scene: Scene, identities: Mapping[str, Identity]
) -> Scene:
    """The scene of a dub, whose cues have the edits of their lines."""
    presets = {name: identity.preset for name, identity in identities.items()}
    longer = dub.on_longer_audio
    edits = edits_of(findings, (*at, "edits"), dub.edits, scene, presets, longer)
    cues = [replace(cue, edit=edits.get(cue.name, Edit())) for cue in scene.cues]
    if scene.film_heard:  # the one cue of another dub has the recording of its take already
        cues = [
            replace(cue, audio=own, audio_start=0.0) if (own := cue.edit.audio) else cue
            for cue in cues
        ]
    return replace(scene, cues=tuple(cues))


def whole_recording(dub: Dub) -> tuple[Path, KeyPath]:
    """The recording of a dub without lines, that of its take, and where in the dub it is named."""
    for k, edit in enumerate(dub.edits):
        if (take := edit.takes.get(edit.take)) is not None and take.audio is not None:
            return take.audio, ("edits", k, "takes", edit.take, "audio")
    assert isinstance(dub.audio, Path)
    return dub.audio, ("audio",)


def edits_of(
    findings: Findings,
    at: KeyPath,
    given: Sequence[edit_entry.Edit],
    scene: Scene,
    presets: Mapping[str, str],
    longer: str = "cut",
) -> dict[str, Edit]:
    """The edits of a scene's cues, by their names; what is wrong goes to findings.

    Args:
        at: place of the list.
        presets: of the models of people.
        longer: what is done with a take's recording that is longer than its line.
    """
    edits: dict[str, Edit] = {}
    for k, edit in enumerate(given):
        key = (*at, k)
        cue = _cue(findings, key, scene, edit)
        if cue is None:
            continue
        if cue.name in edits:
            findings.add(key, f"line {cue.number} has an edit already: write both into one")
        edits[cue.name] = own = checked(findings, key, edit, cue, presets[cue.identity])
        if own.audio is not None and scene.film_heard:
            _fits(findings, (*key, "takes", own.take, "audio"), own.audio, cue, longer)
    return edits


def checked(findings: Findings, key: KeyPath, edit: edit_entry.Edit, cue: Cue, preset: str) -> Edit:
    """The edit of a cue, whose person has a model of a preset; what is wrong goes to findings."""
    if edit.take and edit.take not in edit.takes:
        what = f"line {cue.number} has no take {edit.take!r}"
        close = suggestion(edit.take, [*edit.takes]) or f"; there is {some([*edit.takes])}"
        findings.add((*key, "take"), what + (close if edit.takes else ": write it into takes"))
        return Edit()
    for name, take in edit.takes.items():
        if take.audio is not None and not take.audio.is_file():
            findings.add((*key, "takes", name, "audio"), f"no such file: {take.audio}")
    motion: edit_entry.Edit | edit_entry.Take = edit
    if edit.take:
        motion, key = edit.takes[edit.take], (*key, "takes", edit.take)
    for name, begin in (("keys", "at"), ("film_mouth", "start"), ("moved", "start")):
        for number, one in enumerate(getattr(motion, name)):
            if getattr(one, begin) > cue.seconds:
                late = f"the sound of line {cue.number} ends after {cue.seconds:.2f} s"
                findings.add((*key, name, number, begin), late)
    versions: dict[str, edit_entry.Edit | edit_entry.Take] = {"": edit, **edit.takes}
    takes = tuple((name, _motion(one, cue, name)) for name, one in versions.items())
    found = _motion(motion, cue, edit.take)
    found = replace(found, note=edit.note, status=edit.status, takes=takes if edit.takes else ())
    before = len(findings.problems)
    for name, reasons in WITHOUT.items():
        if preset in reasons and getattr(found, name) != getattr(Edit(), name):
            why = f"preset {preset!r} of {cue.identity} {reasons[preset]}"
            findings.add((*key, name), f"{why}: leave it out, or take preset 'fast'")
    if found.curves is not None and len(findings.problems) == before:
        try:
            LipCurves.read(*found.curves)
        except ExplainedError as error:
            findings.add((*key, "curves"), str(error))
    return found


def _motion(given: edit_entry.Edit | edit_entry.Take, cue: Cue, take: str) -> Edit:
    """The edit of a cue's recording and mouth that an entry or a take gives."""
    return Edit(
        given.shift,
        given.strength,
        keys=tuple((one.at, one.strength) for one in given.keys),
        curves=None if given.curves is None else (given.curves, cue.number),
        take=take,
        film_mouth=tuple((span.start, span.end) for span in given.film_mouth),
        moved=tuple((part.start, part.end, part.shift) for part in given.moved),
        style=given.style,
        audio=given.audio if isinstance(given, edit_entry.Take) else None,
    )


def _fits(findings: Findings, key: KeyPath, audio: Path, cue: Cue, longer: str) -> None:
    """Whether a recording can be heard in a line of a scene."""
    sound = findings.look_for_sound(audio, key)
    frame = cue.seconds / (cue.stop - cue.first)
    if sound is not None and sound.sound_seconds > cue.seconds + frame:
        what = f"{sound.sound_seconds:.2f} s in line {cue.number} of {cue.seconds:.2f} s"
        if longer == "cut":
            findings.warn(f"{audio.name}: {what}: it is cut off with its line")
        else:
            findings.add(key, f"{what}: shorten the recording, or set on_longer_audio: cut")


def _cue(findings: Findings, key: KeyPath, scene: Scene, edit: edit_entry.Edit) -> Cue | None:
    """The cue that an edit is of."""
    numbers = some(list(dict.fromkeys(str(cue.number) for cue in scene.cues)))
    number = 1 if not scene.film_heard and edit.line is None else edit.line
    if number is None:
        findings.add((*key, "line"), f"is required: which line of the scene; there is {numbers}")
        return None
    cues = [cue for cue in scene.cues if cue.number == number]
    if not cues:
        left = [f" ({line.why})" for line in scene.undubbed if line.number == number]
        message = f"nobody dubs a line {number}{''.join(left[:1])}; there is {numbers}"
        findings.add((*key, "line"), message)
        return None
    own = [cue for cue in cues if edit.speaker in (None, cue.speaker)]
    speakers = list(dict.fromkeys(cue.speaker for cue in cues))
    if not own:
        there = f"; it is of {some(speakers)}" if any(speakers) else ": leave it out"
        message = f"{edit.speaker!r} does not speak line {number}"
        close = suggestion(str(edit.speaker), speakers)
        findings.add((*key, "speaker"), message + (close or there))
        return None
    if len(own) > 1:
        remedy = "number them anew" if edit.speaker or len(speakers) == 1 else "name its speaker"
        findings.add((*key, "line"), f"{len(own)} lines have the number {number}: {remedy}")
        return None
    return own[0]
