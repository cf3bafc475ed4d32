"""The production of a manifest's entries: names, files and defaults are resolved."""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from dubbing.engine.disk.files import same_on_disk
from dubbing.errors import ExplainedError, RenderingError
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.manifest.checks.inputs import credits_text
from dubbing.manifest.checks.provenance_checks import signer_of
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import consent_entry, dub_entry, identity_entry
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.mixing.sound import Sound
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.production.clip import Clip, PersonClip
from dubbing.production.dub import Dub
from dubbing.production.person import Consent, Person
from dubbing.production.production import Production
from dubbing.provenance.card import CreditsCard
from dubbing.script import timeline
from dubbing.shipped.base import shipped_base
from dubbing.sound_to_lips.paths import speech_weights
from dubbing.video.settings import VideoSettings


def resolved(
    path: Path, output: Path, dubs: Mapping[int, dub_entry.Dub], findings: Findings
) -> Production:
    """The production of a manifest without mistakes.

    Args:
        dubs: by their place in the list; people are those of the findings.
    """
    people = {name: _person(name, findings) for name in findings.identities}
    made = {
        dub.name: replace(
            _dub(place, dub, people, findings),
            fixed_edits="edits" in dub.model_fields_set and not edits_file(path, dub.name).exists(),
        )
        for place, dub in dubs.items()
        if place in findings.dubs
    }
    names = frozenset(dub.name for dub in dubs.values())
    if made:
        for person in people.values():
            findings.warnings += person.learned_minutes()
    return Production(path, output, people, made, names, tuple(findings.warnings))


def _person(name: str, findings: Findings) -> Person:
    identity = findings.identities[name]
    clips = {film: _clip(name, film, findings) for film in identity.films}
    return Person(
        name=name,
        clips=tuple(clips.values()),
        learned=tuple(clips[film] for film in identity.learned_clips),
        consent=_consent(identity.consent),
        start=identity.learned_start,
        seconds=identity.learned_seconds,
        size=identity.size,
        settings=FinetuneSettings(
            preset=identity.preset,
            seed=identity.seed,
            speech=identity.speech,
            speech_weights=str(weights) if (weights := identity.speech_weights) else None,
            **identity.finetune.model_dump(),
        ),
        speech_files=speech_weights(identity.speech, identity.speech_weights),
        base=identity.base or shipped_base(identity.preset),
        own_base=identity.base is not None,
        own_iterations=identity.finetune.iterations is not None,
    )


def _clip(name: str, film: Path, findings: Findings) -> PersonClip:
    return PersonClip(
        film,
        findings.media.get(film),
        findings.damaged.get(film),
        clip_name(findings.identities[name], film),
        _portraits(name, film, findings),
    )


def clip_name(identity: identity_entry.Identity, clip: Path) -> str:
    """Name of a clip in the names of its stages; '' for the one that is learned from.

    Its own name, or where an earlier clip has it already, with the first number that is free. No
    two names are one on a disk that knows no capitals, or only one form of a letter with an accent.
    """
    if clip == identity.clip:
        return ""
    taken: dict[str, Path] = {}
    for film in identity.films:
        names = itertools.chain([film.stem], (f"{film.stem}-{k}" for k in itertools.count(2)))
        name = next(name for name in names if same_on_disk(name) not in taken)
        taken[same_on_disk(name)] = film
        if film == clip:
            return name
    raise ValueError(clip)


def _portraits(name: str, clip: Path, findings: Findings) -> tuple[Portrait, ...]:
    """How to recognise a person in a clip, and the others whose clip it is.

    Empty where the person is the largest face of the clip.
    """
    own, largest = _portrait(findings.identities[name], clip), Portrait(clip)
    if own == largest:
        return ()
    others = {
        _portrait(identity, clip)
        for other, identity in findings.identities.items()
        if other != name and clip in identity.films
    }
    others -= {own, largest}
    known = (one for one in others if one.clip not in findings.damaged)
    return own, *sorted(known, key=lambda one: (one.points, one.clip))


def _portrait(identity: identity_entry.Identity, clip: Path) -> Portrait:
    """A person as they are known in a clip; see `Identity.shown_for`."""
    film, points = identity.shown_for(clip)
    return Portrait(film, tuple((point.at, point.x, point.y) for point in points))


def _consent(consent: consent_entry.Consent) -> Consent:
    """An agreement with its proof: of a form that names the file that was signed, both files."""
    files = {"sha256": consent.form or consent.file}
    if consent.form is not None:
        files["file_sha256"] = consent.file
    return Consent(consent.terms(), {key: path for key, path in files.items() if path is not None})


def _dub(place: int, dub: dub_entry.Dub, people: Mapping[str, Person], findings: Findings) -> Dub:
    own = tuple(people[name] for name in dub.people)
    scene = findings.scenes.get(place)
    path = scene.clip if scene else dub.clip or own[0].clip.path
    film = Clip(path, findings.media.get(path), findings.damaged.get(path))
    scene = scene or Scene(path)
    return Dub(
        name=dub.name,
        people=own,
        film=film,
        sound=Sound(scene.cues, scene.film_heard, dub.music_effects, scene.left, dub.loudness),
        length=scene.length,
        first=scene.first,
        on_longer_audio=scene.on_longer_audio,
        baked=dub.render == "baked",
        undubbed=scene.undubbed,
        events=dub.events,
        settings=VideoSettings(
            frame=dub.frame,
            label=dub.codec != "ffv1" if dub.label.mark is None else dub.label.mark,
            card=_card(dub, film, findings) if scene.cues else None,
            codec=dub.codec,
            deliver=dub.deliver,
            audio_rate=None if dub.audio_rate == "source" else dub.audio_rate,
        ),
        marked=dub.mark is not None,
        mark_key=dub.mark.key if dub.mark else None,
        signer=signer_of(dub),
        blocked=findings.blocked.get(place) or _too_long(dub.name, scene, film),
    )


def _card(dub: dub_entry.Dub, film: Clip, findings: Findings) -> CreditsCard | None:
    if dub.label.credits is None:
        return None
    frames = timeline.frame_count(dub.label.credits.seconds, film.rate)
    return CreditsCard(credits_text(dub, findings.identities), frames)


def _too_long(name: str, scene: Scene, film: Clip) -> ExplainedError | None:
    """With ``on_longer_audio: fail`` a dub that is longer than its film cannot be made."""
    left = film.frames - scene.first
    if scene.on_longer_audio != "fail" or scene.length <= left:
        return None
    return RenderingError(
        f"the speech lasts {scene.length} frames, the clip {left} from video_start on",
        name,
        "set on_longer_audio to bounce, loop, hold or cut, or use a longer clip",
    )
