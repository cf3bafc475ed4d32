"""The lines of a script as frames of a film, each with its sound.

A dub without lines is a scene of one speaker, whose one cue is the whole audio.
"""

from collections.abc import Mapping
from itertools import groupby

from dubbing.errors import ExplainedError
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.manifest.scenes import reels
from dubbing.manifest.scenes.cues import CUE, SceneCues
from dubbing.media import MediaInfo
from dubbing.script import timeline
from dubbing.script.reading import read_lines
from dubbing.script.timeline import Cue

# Keys that only lines give a meaning, and those that they take it from.
OF_SCENES = ("speakers", "music_effects", "reel_start")
OF_ONE_SOUND = ("audio_start", "audio_seconds", "video_start")


def inspect_scene(
    findings: Findings, place: int, dub: Dub, identities: Mapping[str, Identity]
) -> None:
    """Check a dub that has lines; where all is well it becomes one of ``findings.scenes``."""
    at: KeyPath = ("dubs", place)
    before = len(findings.problems)
    _keys(findings, at, dub)
    assert dub.lines is not None
    film = film_of(findings, at, dub, identities)
    if not dub.lines.is_file():
        findings.add((*at, "lines"), f"no such file: {dub.lines}")
        return
    if film is None or film.picture is None:
        return
    try:
        every = read_lines(dub.lines, film.timecode_rate, _speakers(dub))
    except ExplainedError as error:
        findings.add((*at, "lines"), str(error))
        return
    dealt = reels.of_film(findings, at, dub, film, every)
    scene = SceneCues(findings, at, dub, film, reel=dealt.reel)
    for _, cue in groupby(dealt.lines, key=lambda line: line.shared and (line.start, line.stop)):
        scene.add_all(list(cue))
    scene.check(every)
    if len(findings.problems) == before and place not in findings.blocked:
        scene.warn(len(dealt.lines))
        cues = tuple(sorted(scene.cues, key=lambda cue: cue.first))
        findings.scenes[place] = Scene(
            film.path,
            cues,
            length=film.frames,
            film_heard=True,
            left=tuple(scene.left),
            undubbed=tuple(scene.undubbed),
        )


def _speakers(dub: Dub) -> tuple[str, ...]:
    """The names of speakers that a manifest has for a script."""
    return tuple(dub.speakers or (dub.audio if isinstance(dub.audio, dict) else ()))


def film_of(
    findings: Findings, at: KeyPath, dub: Dub, identities: Mapping[str, Identity]
) -> MediaInfo | None:
    """The film of a dub, which is a clip of everybody in it; None where that is not known."""
    people = {name: identities[name] for name in dub.people if name in identities}
    for name, identity in people.items():
        if dub.clip is None and len(identity.films) > 1:
            findings.add((*at, "clip"), f"is required: {name} has {len(identity.films)} clips")
            return None
        if dub.clip is not None and dub.clip not in identity.films:
            findings.add((*at, "clip"), f"{dub.clip} is no clip of {name}")
            return None
    # Whoever learns from another clip is recognised by that clip.
    faceless = [
        name
        for name, identity in people.items()
        if identity.shown_for(dub.clip or identity.clip) == (dub.clip or identity.clip, ())
    ]
    if len(people) > 1 and faceless:
        message = "several people in a film need `face`, or another clip to learn from"
        findings.add((*at, "speakers"), f"{' and '.join(faceless)}: {message}")
        return None
    clips = [dub.clip or identity.clip for identity in people.values()]
    if len({*clips}) > 1:
        findings.add((*at, "speakers"), f"{' and '.join(people)} are people of different clips")
        return None
    # Where somebody learns from the damaged clip, their own job reports it.
    learned = {identity.clip for identity in people.values()}
    if clips and clips[0] in findings.damaged and clips[0] not in learned:
        findings.blocked.setdefault(int(at[1]), findings.damaged[clips[0]])
    return findings.media.get(clips[0]) if clips else None


def _keys(findings: Findings, at: KeyPath, dub: Dub) -> None:
    """Keys that have no meaning together."""
    if dub.identity is not None and dub.speakers is not None:
        message = "name either who speaks all lines, or the identity of each speaker under speakers"
        findings.add((*at, "identity"), message)
    for key in OF_ONE_SOUND:
        if key in dub.model_fields_set and getattr(dub, key):
            findings.add((*at, key), "has no meaning beside lines, which have their own times")
    if dub.on_longer_audio in ("loop", "hold"):
        message = "a scene is as long as its film: cut or fail beside lines"
        findings.add((*at, "on_longer_audio"), message)
    if dub.frame != "full":
        findings.add((*at, "frame"), "a scene is its whole film: full beside lines")
    if dub.audio_rate == "source":
        findings.add((*at, "audio_rate"), "the sound of a scene is mixed at 48000")


def without_lines(findings: Findings, at: KeyPath, dub: Dub) -> bool:
    """Check that a dub without lines has no key that needs them."""
    before = len(findings.problems)
    for key in OF_SCENES:
        if getattr(dub, key) is not None:
            findings.add((*at, key), "needs lines, which name who speaks when")
    if dub.loudness != "none":
        findings.add((*at, "loudness"), "needs lines, whose sound is mixed")
    if isinstance(dub.audio, dict) or CUE.search(str(dub.audio)):
        findings.add((*at, "audio"), "several sounds need lines, which name who speaks when")
    return len(findings.problems) == before


def whole_audio(dub: Dub, film: MediaInfo, sound: MediaInfo) -> Scene:
    """The scene of one speaker whose one cue is the whole audio."""
    assert dub.identity is not None
    left = sound.sound_seconds - dub.audio_start
    seconds = min(left, dub.audio_seconds) if dub.audio_seconds else left
    frames = timeline.frame_count(seconds, film.rate)
    cue = Cue(dub.identity, 0, frames, sound.path, dub.audio_start, seconds)
    first = timeline.first_frame(dub.video_start, film.rate)
    return Scene(film.path, (cue,), frames, first, dub.on_longer_audio)
