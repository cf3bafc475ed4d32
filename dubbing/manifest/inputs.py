"""The files a manifest names: are they there, and do they hold what they are used for?"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dubbing import timeline
from dubbing.errors import DubbingError, MediaError
from dubbing.manifest import preset_checks as published
from dubbing.manifest import terms
from dubbing.manifest.entries import Dub, Identity
from dubbing.media import SUFFIX
from dubbing.media.muxing import MOST_CHANNELS, SOUND
from dubbing.media.probing import MediaInfo, probe
from dubbing.provenance import credentials
from dubbing.provenance.credentials import Signer
from dubbing.provenance.mark_key import read_key
from dubbing.speech import features

SHORTEST_CLIP = 1.0  # seconds to learn from
KeyPath = tuple[str | int, ...]


@dataclass
class Findings:
    """What the files hold, the damaged ones, and what is wrong with how they are used."""

    media: dict[Path, MediaInfo] = field(default_factory=dict)
    damaged: dict[Path, MediaError] = field(default_factory=dict)
    problems: list[tuple[KeyPath, str]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def look(self, path: Path, key: KeyPath) -> MediaInfo | None:
        """Probe a file once. One that is missing is a problem; one that is damaged is kept."""
        if not path.is_file():
            self.problems.append((key, f"no such file: {path}"))
            return None
        if path not in self.media and path not in self.damaged:
            try:
                self.media[path] = probe(path)
            except MediaError as error:
                self.damaged[path] = error
        return self.media.get(path)


def inspect(identities: Mapping[str, Identity], dubs: Mapping[int, Dub]) -> Findings:
    """Check the files of identities (by name) and of dubs (by their place in the list)."""
    findings = Findings()
    for name, identity in identities.items():
        _identity(findings, name, identity)
    for place, dub in dubs.items():
        _dub(findings, place, dub, identities.get(dub.identity))
    return findings


def _identity(findings: Findings, name: str, identity: Identity) -> None:
    at: KeyPath = ("identities", name)
    if identity.base is not None and not identity.base.is_file():
        findings.problems.append(((*at, "base"), f"no such file: {identity.base}"))
    elif said := published.base_problem(identity):
        findings.problems.append(((*at, "base"), said))
    findings.warnings += [f"identities.{name}: {n}" for n in published.identity_notes(identity)]
    for key, said in terms.of_identity(identity, datetime.date.today()):
        findings.problems.append(((*at, *key), said))
    _speech(findings, at, identity)
    info = findings.look(identity.clip, (*at, "clip"))
    if info is None:
        return
    if info.rate is None:
        findings.problems.append(((*at, "clip"), f"no picture in {identity.clip}"))
        return
    if info.audio_rate is None:
        message = f"no sound in {identity.clip}: a face is learnt together with its speech"
        findings.problems.append(((*at, "clip"), message))
    left = info.duration - identity.start
    if left < SHORTEST_CLIP:
        message = f"{identity.start:g} s leaves nothing to learn from: the clip is"
        findings.problems.append(((*at, "start"), f"{message} {info.duration:.1f} s long"))
    elif left < identity.seconds:
        findings.warnings.append(
            f"identities.{name}: learns from {left:.1f} s, all there is, instead of"
            f" {identity.seconds:g} s; nothing is held out"
        )
    if info.variable_rate:
        findings.warnings.append(
            f"identities.{name}: {identity.clip.name} has a variable frame rate;"
            f" it is read at {float(info.rate):g} a second"
        )


def signer_of(dub: Dub) -> Signer | None:
    """Who signs a dub; None where nobody does."""
    return Signer(dub.certificate, dub.key) if dub.certificate and dub.key else None


def _speech(findings: Findings, at: KeyPath, identity: Identity) -> None:
    name, weights = identity.speech, identity.speech_weights
    if weights is not None and name in features.WITHOUT_WEIGHTS:
        findings.problems.append(((*at, "speech_weights"), f"{name} features have no weights"))
        return
    try:
        file = features.weights_file(name, weights)
    except DubbingError as error:
        key = "speech" if weights is None else "speech_weights"
        findings.problems.append(((*at, key), str(error)))
        return
    if file is not None and not file.is_file():
        findings.problems.append(((*at, "speech_weights"), f"no such file: {file}"))


def _provenance(findings: Findings, at: KeyPath, dub: Dub) -> None:
    """The keys that mark and sign a dub."""
    if dub.mark is not None and dub.mark.key is not None:
        try:
            read_key(dub.mark.key)
        except DubbingError as error:
            findings.problems.append(((*at, "mark", "key"), str(error)))
    if (signer := signer_of(dub)) is not None:
        if said := credentials.problem(signer, SUFFIX[dub.codec]):
            findings.problems.append(((*at, "certificate"), said))
    elif dub.certificate or dub.key:
        findings.problems.append(((*at, "key"), "to sign needs both, certificate and key"))


def _dub(findings: Findings, place: int, dub: Dub, identity: Identity | None) -> None:
    at: KeyPath = ("dubs", place)
    _provenance(findings, at, dub)
    if identity is not None:
        findings.problems += [((*at, *key), said) for key, said in terms.of_dub(dub, identity)]
    sound = findings.look(dub.audio, (*at, "audio"))
    if sound is not None:
        if sound.audio_rate is None:
            findings.problems.append(((*at, "audio"), f"no sound in {dub.audio}"))
        elif (sound.audio_channels or 0) > (most := MOST_CHANNELS[SOUND[dub.codec]]):
            message = f"{sound.audio_channels} channels in {dub.audio}: {dub.codec} takes {most}"
            findings.problems.append(((*at, "audio"), f"{message} at most; mix it down"))
        elif dub.audio_start >= sound.sound_seconds:
            message = f"{dub.audio_start:g} s is past the end: the sound is"
            problem = f"{message} {sound.sound_seconds:.1f} s long"
            findings.problems.append(((*at, "audio_start"), problem))
        elif dub.audio_seconds and dub.audio_start + dub.audio_seconds > sound.sound_seconds + 0.5:
            message = f"there are only {sound.sound_seconds - dub.audio_start:.1f} s of sound"
            findings.problems.append(((*at, "audio_seconds"), message))
    clip = findings.media.get(identity.clip) if identity else None
    if clip is None or clip.rate is None:
        return
    if timeline.first_frame(dub.video_start, clip.rate) >= clip.frames:
        last = float((clip.frames - 1) / clip.rate)
        message = f"{dub.video_start:g} s is past the end: the last frame of the clip is at"
        findings.problems.append(((*at, "video_start"), f"{message} {last:.2f} s"))
    if identity is not None and sound is not None:
        left = sound.sound_seconds - dub.audio_start
        seconds = min(left, dub.audio_seconds or left)
        note = published.dub_note(dub.name, identity, clip.rate, seconds)
        findings.warnings += [] if note is None else [note]
