"""What of a manifest the stages of a job depend on, beside the results of other stages."""

from pathlib import Path
from typing import Any

from dubbing.engine.stage import digest_of
from dubbing.errors import DubbingError, RenderingError
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.findings import Scene
from dubbing.manifest.inputs import credits_text
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.terms import sha256_of
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.provenance.card import CreditsCard
from dubbing.provenance.mark_key import Marking, marking
from dubbing.script import timeline
from dubbing.sound_to_lips.paths import ENCODER_WEIGHTS, FILTER_WEIGHTS
from dubbing.speech import features
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS as ACOUSTIC_WEIGHTS
from dubbing.speech.weight_paths import of_package, voice_detector_weights
from dubbing.sync.weight_path import SYNC_WEIGHTS

# Networks of MediaPipe, in its package.
FACES = (
    "modules/face_detection/face_detection_short_range.tflite",
    "modules/face_landmark/face_landmark_with_attention.tflite",
)
PERSON = "modules/selfie_segmentation/selfie_segmentation.tflite"


def frames_of(dub: Dub) -> dict[str, Any]:
    """Which frames of the clip a dub of one sound takes."""
    if dub.lines is not None:
        return {}
    return {"video_start": dub.video_start, "on_longer_audio": dub.on_longer_audio}


def mix_of(dub: Dub, scene: Scene) -> dict[str, Any]:
    """What of a dub its sound depends on, beside the files."""
    if dub.lines is None:
        (cue,) = scene.cues
        return {"audio_start": cue.audio_start, "seconds": cue.seconds}
    cues = [[cue.name, cue.audio_start, cue.seconds] for cue in scene.cues]
    return {"cues": cues, "left": [*map(list, scene.left)], "loudness": dub.loudness}


def sounds_of(dub: Dub, scene: Scene) -> dict[str, Path]:
    """The sounds of a dub by what they are in it."""
    if dub.lines is None:
        return {"audio": scene.cues[0].audio}
    found = {f"audio {cue.name}": cue.audio for cue in scene.cues}
    return found if dub.music_effects is None else {**found, "music": dub.music_effects}


def portraits_of(manifest: Manifest, name: str, clip: Path) -> tuple[Portrait, ...]:
    """How to recognise a person of the manifest in a clip, and the others whose clip it is.

    Empty where the person is the largest face of the clip.
    """
    own, plain = portrait_of(manifest.identities[name]), Portrait(clip)
    if own == plain:
        return ()
    others = {
        portrait_of(identity)
        for other, identity in manifest.identities.items()
        if other != name and clip in identity.films
    }
    others -= {own, plain}
    known = (one for one in others if one.clip not in manifest.damaged)
    return own, *sorted(known, key=lambda one: (one.points, one.clip))


def portrait_of(identity: Identity) -> Portrait:
    """What shows a person: the points of their first clip, or the clip that is learned from."""
    points = tuple((point.at, point.x, point.y) for point in identity.face)
    return Portrait(identity.films[0] if points else identity.clip, points)


def speech_weights(identity: Identity) -> dict[str, Path]:
    """The weights of what hears an identity's speech: its features, and the lips of it."""
    files = features.weights_files(identity.speech, identity.speech_weights)
    own = {f"speech_weights {name}".strip(): file for name, file in files.items()}
    lips = {"lip_encoder": ENCODER_WEIGHTS, "lip_filter": FILTER_WEIGHTS}
    return {**own, **lips, **voice_detector_weights()}


def check_weights() -> dict[str, Path]:
    """The weights of the sync check: its own, what it hears with, and what finds faces."""
    own = {"sync_weights": SYNC_WEIGHTS, "acoustic_weights": ACOUSTIC_WEIGHTS}
    return {**own, **voice_detector_weights(), **of_package("mediapipe", *FACES)}


def prepare_weights() -> dict[str, Path]:
    """The networks that find faces, and the person round a face."""
    return of_package("mediapipe", *FACES, PERSON)


def mark_of(dub: Dub, scene: Scene) -> Marking | None:
    """The invisible mark of a dub: its bits name the clip and the sounds that it was made from."""
    if dub.mark is None:
        return None
    files = (scene.clip, *sounds_of(dub, scene).values())
    return marking(dub.mark.key, [digest_of(file) for file in files])


def card_of(manifest: Manifest, dub: Dub, scene: Scene) -> CreditsCard | None:
    """The card of credits after a dub."""
    if dub.label.credits is None:
        return None
    frames = timeline.frame_count(dub.label.credits.seconds, manifest.media[scene.clip].rate)
    return CreditsCard(credits_text(dub, manifest.identities), frames)


def consent_of(identity: Identity) -> dict[str, Any]:
    """Who agreed to what, as it is recorded: with the digest of the form, not with its place.

    Of a form that names the file that was signed, both digests.
    """
    consent = identity.consent
    names = {"sha256": consent.form or consent.file}
    if consent.form is not None:
        names["file_sha256"] = consent.file
    return {**consent.terms(), **{key: sha256_of(path) for key, path in names.items() if path}}


def consents_of(manifest: Manifest, dub: Dub) -> Any:
    """Who agreed to a dub: of one person, or by name of several."""
    given = {name: consent_of(manifest.identities[name]) for name in dub.people}
    return given if len(given) > 1 else next(iter(given.values()))


def signed_facts(manifest: Manifest, dub: Dub, scene: Scene) -> dict[str, Any]:
    """What the credentials of a dub state, beside its models: consent, sound, mark."""
    consents = [consent_of(manifest.identities[name]) for name in dub.people]
    mark = mark_of(dub, scene)
    return {
        "consent": [
            {key: consent[key] for key in ("reference", "sha256", "file_sha256") if key in consent}
            for consent in consents
        ],
        "audio": [digest_of(path) for path in sounds_of(dub, scene).values()],
        "digests": "BLAKE2b-128",
        "mark": mark.id if mark else None,
    }


def composite_parameters(
    manifest: Manifest, dub: Dub, scene: Scene, mark: Marking | None, card: CreditsCard | None
) -> dict[str, Any]:
    """What a finished video depends on, beside files and other stages."""
    return {
        **{key: getattr(dub, key) for key in ("frame", "codec", "audio_rate")},
        "label": dub.label.mark,
        **({"credits": [card.text, card.frames]} if card else {}),
        **frames_of(dub),
        **mix_of(dub, scene),
        "mark": [mark.fingerprint, mark.id] if mark else None,
        # No pixel depends on it, but the record of a result names who agreed to it.
        "consent": consents_of(manifest, dub),
    }


def too_long(manifest: Manifest, dub: Dub, scene: Scene) -> DubbingError | None:
    """With ``on_longer_audio: fail`` a dub that is longer than its clip cannot be made."""
    film = manifest.media[scene.clip]
    frames = max(cue.stop for cue in scene.cues)
    left = film.frames - timeline.first_frame(dub.video_start, film.rate)
    if dub.on_longer_audio != "fail" or frames <= left:
        return None
    return RenderingError(
        f"the speech lasts {frames} frames, the clip {left} from video_start on",
        dub.name,
        "set on_longer_audio to bounce, loop, hold or cut, or use a longer clip",
    )
