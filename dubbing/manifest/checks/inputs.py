"""The files a manifest names: are they there, and do they hold what they are used for?"""

import datetime
from collections.abc import Mapping

from dubbing.engine.disk.numbered import plain
from dubbing.errors import ExplainedError
from dubbing.manifest.checks import film_checks, provenance_checks, sound_checks, terms
from dubbing.manifest.checks import preset_checks as published
from dubbing.manifest.edits.edits import edited, whole_recording
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.values import BEST
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.manifest.scenes.scenes import film_of, inspect_scene, whole_audio, without_lines
from dubbing.media import MediaInfo
from dubbing.media.writing.muxing import MOST_CHANNELS, SOUND
from dubbing.provenance import card
from dubbing.script import timeline
from dubbing.speech import features

SHORTEST_CLIP = 1.0  # seconds to learn from


def inspect(identities: Mapping[str, Identity], dubs: Mapping[int, Dub]) -> Findings:
    """Check the files of identities (by name) and of dubs (by their place in the list)."""
    findings = Findings()
    for name, identity in identities.items():
        findings.identities[name] = _learning(findings, name, identity)
        _identity(findings, name, findings.identities[name])
        sound_checks.of_learning(findings, name, findings.identities[name])
    for place, dub in dubs.items():
        findings.dubs.add(place)
        _dub(findings, place, dub, findings.identities)
    for info in findings.media.values():
        sound_checks.of_tracks(findings, info)
    return findings


def _learning(findings: Findings, name: str, identity: Identity) -> Identity:
    """The identity with the clips that it learns from: the first that has enough, or all."""
    at: KeyPath = ("identities", name)
    keys: list[KeyPath] = [(*at, "clips", k) for k in range(len(identity.clips))] or [(*at, "clip")]
    found = {}
    for path, key in zip(identity.clips or (identity.clip,), keys, strict=True):
        info = findings.look(path, key)
        if info is not None and info.picture is None:
            findings.add(key, f"no picture in {path}")
        elif info is not None:
            film_checks.of_picture(findings, name, info, key)
            found[path] = info.duration - identity.start if info.audio_rate else 0.0
    wanted = None if identity.seconds == BEST else identity.learned_seconds  # None: of all of them
    enough = [path for path, left in found.items() if wanted is not None and left >= wanted]
    if enough or not found:
        return identity.learning_from(enough[0] if enough else identity.clip)
    longest = max(found, key=lambda path: found[path])
    return identity.learning_from(
        longest, *(path for path, left in found.items() if left > 0 and path != longest)
    )


def _identity(findings: Findings, name: str, identity: Identity) -> None:
    at: KeyPath = ("identities", name)
    if identity.base is not None and not identity.base.is_file():
        findings.add((*at, "base"), f"no such file: {identity.base}")
    elif problem := published.base_problem(identity):
        findings.add((*at, "base"), problem)
    elif problem := published.speech_problem(identity):
        findings.baseless.append(((*at, "base"), problem))
    if identity.finetune.references is not None and identity.preset != "fast":
        problem = f"preset {identity.preset!r} has a fixed number of them; leave it out"
        findings.add((*at, "finetune", "references"), problem)
    findings.warnings += [f"identities.{name}: {n}" for n in published.identity_notes(identity)]
    for key, problem in terms.of_identity(identity, datetime.date.today()):
        findings.add((*at, *key), problem)
    _speech(findings, at, identity)
    _faces(findings, at, identity)
    film_checks.of_options(findings, at, identity)
    info = findings.media.get(identity.clip)
    if info is None or info.picture is None:
        return
    if info.audio_rate is None:
        message = f"no sound in {plain(identity.clip)}: a face is learnt together with its speech"
        findings.add((*at, "clip"), message)
    if identity.seconds == BEST and identity.start:
        findings.add(
            (*at, "start"), "leave it out: the best seconds are looked for in all the clip"
        )
    left = info.duration - identity.start
    for clip in identity.learned_clips[1:]:
        left += findings.media[clip].duration - identity.start
    if left < SHORTEST_CLIP:
        message = f"{identity.start:g} s leaves nothing to learn from: the clip is"
        findings.add((*at, "start"), f"{message} {info.duration:.1f} s long")
    elif left < identity.learned_seconds:
        findings.warn(
            f"identities.{name}: learns from {left:.1f} s, all there is, instead of"
            f" {identity.learned_seconds:g} s; nothing is held out"
        )


def _faces(findings: Findings, at: KeyPath, identity: Identity) -> None:
    for k, point in enumerate(identity.face):
        film = identity.film_of(point)
        if film is None:
            findings.add((*at, "face", k, "clip"), f"{point.clip} is no clip of {at[-1]}")
            continue
        shown = findings.media.get(film)
        if shown is not None and shown.picture is not None and point.at > shown.duration:
            message = f"{point.at:g} s is past the end: the clip is {shown.duration:.1f} s long"
            findings.add((*at, "face", k, "at"), message)


def credits_text(dub: Dub, identities: Mapping[str, Identity]) -> str:
    """The text on the card of a dub; '' where it has none."""
    if dub.label.credits is None:
        return ""
    agreed = [identities[name].consent.by for name in dub.people if name in identities]
    return dub.label.credits.text or card.default_text(agreed)


def _speech(findings: Findings, at: KeyPath, identity: Identity) -> None:
    name, weights = identity.speech, identity.speech_weights
    if weights is not None and name in features.WITHOUT_WEIGHTS:
        findings.add((*at, "speech_weights"), f"{name} features have no weights")
        return
    try:
        file = features.weights_file(name, weights)
    except ExplainedError as error:
        key = "speech" if weights is None else "speech_weights"
        findings.add((*at, key), str(error))
        return
    if file is not None and not file.is_file():
        findings.add((*at, "speech_weights"), f"no such file: {file}")


def _dub(findings: Findings, place: int, dub: Dub, identities: Mapping[str, Identity]) -> None:
    at: KeyPath = ("dubs", place)
    provenance_checks.inspect_keys(findings, at, dub)
    if not dub.people:
        findings.add((*at, "identity"), "is required")
        return
    if letters := card.undrawable(credits_text(dub, identities)):
        message = f"the card has no letters for {letters[:20]!r}: give it a text without them"
        findings.add((*at, "label", "credits", "text"), message)
    for identity in (identities[name] for name in dub.people if name in identities):
        for key, problem in terms.of_dub(dub, identity):
            findings.add((*at, *key), problem)
    if dub.lines is not None:
        inspect_scene(findings, place, dub, identities)
        _music(findings, at, dub)
    elif without_lines(findings, at, dub):
        _whole_audio(findings, place, dub, identities)
    scene = findings.scenes.get(place)
    if scene is not None:
        findings.scenes[place] = edited(findings, at, dub, scene, identities)
        provenance_checks.inspect_film(findings, at, dub, scene.clip)
        sound_checks.of_dub(findings, at, dub, scene)
        film_checks.of_codec(findings, at, dub, scene)
        film_checks.of_delivery(findings, at, dub, scene)
        _slow(findings, dub, scene, identities)


def _whole_audio(
    findings: Findings, place: int, dub: Dub, identities: Mapping[str, Identity]
) -> None:
    """A dub of one sound."""
    at: KeyPath = ("dubs", place)
    audio, within = whole_recording(dub)
    before = len(findings.problems)
    sound = findings.look_for_sound(audio, (*at, *within))
    if sound is not None:
        if dub.audio_start >= sound.sound_seconds:
            message = f"{dub.audio_start:g} s is past the end: the sound is"
            findings.add((*at, "audio_start"), f"{message} {sound.sound_seconds:.1f} s long")
        elif dub.audio_seconds and dub.audio_start + dub.audio_seconds > sound.sound_seconds + 0.5:
            message = f"there are only {sound.sound_seconds - dub.audio_start:.1f} s of sound"
            findings.add((*at, "audio_seconds"), message)
        _check_channels(findings, (*at, *within), dub, sound)
    clip = film_of(findings, at, dub, identities)
    if clip is None or clip.picture is None:
        return
    if timeline.first_frame(dub.video_start, clip.rate) >= clip.frames:
        last = float((clip.frames - 1) / clip.rate)
        message = f"{dub.video_start:g} s is past the end: the last frame of the clip is at"
        findings.add((*at, "video_start"), f"{message} {last:.2f} s")
    if sound is not None and len(findings.problems) == before:
        findings.scenes[place] = whole_audio(dub, clip, sound)


def _music(findings: Findings, at: KeyPath, dub: Dub) -> None:
    """Check the music and effects under the voices of a scene."""
    if dub.music_effects is None:
        return
    key = (*at, "music_effects")
    sound = findings.look_for_sound(dub.music_effects, key)
    if sound is not None:
        _check_channels(findings, key, dub, sound)


def _check_channels(findings: Findings, key: KeyPath, dub: Dub, sound: MediaInfo) -> None:
    most = MOST_CHANNELS[SOUND[dub.codec]]
    if (sound.audio_channels or 0) > most:
        count = f"{sound.audio_channels} channels in {sound.path}"
        findings.add(key, f"{count}: {dub.codec} takes {most} at most; mix it down")


def _slow(findings: Findings, dub: Dub, scene: Scene, identities: Mapping[str, Identity]) -> None:
    """Warn of dubs that take days."""
    rate = findings.media[scene.clip].rate
    for person in dub.people:
        seconds = sum(cue.seconds for cue in scene.cues if cue.identity == person)
        note = published.dub_note(dub.name, identities[person], rate, seconds)
        if note is not None:
            findings.warn(note)
