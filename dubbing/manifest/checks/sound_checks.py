"""Checks of sounds for `plan`: tracks and channels that are heard, silent and longer ones.

It is quick: of a sound with one channel nothing is read but up to its first sound.
"""

import math
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from dubbing.errors import MediaError
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.messages import some
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.media import MediaInfo
from dubbing.media.opening.opening import LAYOUTS
from dubbing.media.reading.voice_channel import are_silent, is_silent, voice_channel
from dubbing.script.timeline import Cue

MOST_CHANNELS = max(LAYOUTS)  # of the bed of a scene
# Of so many cues of one file, spread over it, the channels are looked at.
LOOKED_AT = 12
OTHER_CUT = 0.5  # seconds by which music and effects are longer or shorter than their film
WHY_NOT_ALL = {
    "centre": "have a centre",
    "opposed": "cancel one another",
    "unused": "are silent in part",
}
AT_THE_END = {
    "bounce": "the film's last shot runs backwards and forwards below the last {}",
    "loop": "the film begins again below the last {}",
    "hold": "the film's last picture stands below the last {}",
    "cut": "what is longer, {}, is cut off",
}


def of_learning(findings: Findings, name: str, identity: Identity) -> None:
    """The sound that a person is learned with."""
    for clip in identity.learned_clips:
        info = findings.media.get(clip)
        if info is None or info.audio_rate is None:
            continue
        start, seconds = identity.learned_start, identity.learned_seconds
        stretch = (0.0, info.sound_seconds) if start is None else (start, seconds)
        with suppress(MediaError):  # learning reports it
            if stretch[0] < info.sound_seconds and is_silent(info, *stretch):
                message = f"nothing can be heard in {clip} in the seconds to learn from"
                remedy = "a face is learnt together with its speech"
                findings.add(("identities", name, "clip"), f"{message}: {remedy}")
                continue
            _channels(findings, f"identities.{name}", info, [stretch])


def of_dub(findings: Findings, at: KeyPath, dub: Dub, scene: Scene) -> None:
    """The sounds of a dub's cues, and how they fit its film."""
    by_file: dict[Path, list[Cue]] = {}
    for cue in scene.cues:
        by_file.setdefault(cue.audio, []).append(cue)
    silent = []
    with suppress(MediaError):  # the stage that reads it reports it
        for path, cues in by_file.items():
            info, stretches = findings.media[path], [(c.audio_start, c.seconds) for c in cues]
            found = zip(cues, are_silent(info, stretches), strict=True)
            silent += [str(cue.number) for cue, is_so in found if is_so]
            _channels(findings, dub.name, info, stretches[:: 1 + len(stretches) // LOOKED_AT])
            if info.peak > 1 and dub.loudness == "none":
                over = f"up to {20 * math.log10(info.peak):.1f} dB above full scale"
                clipped = "is clipped there: make it softer, or set loudness in a scene"
                findings.warn(f"{dub.name}: {path.name} is {over}, and {clipped}")
    if silent and len(scene.cues) == 1:
        findings.warn(f"{dub.name}: nothing can be heard in {scene.cues[0].audio}")
    elif silent:
        what = f"nothing can be heard in the sound of lines {some(silent)}"
        findings.warn(f"{dub.name}: {what}: mouths stay shut, and they are silent")
    film = findings.media[scene.clip]
    if scene.film_heard:
        _bed(findings, at, dub, film, speaks=bool(scene.left))
    _longer(findings, dub.name, scene, film)


def _channels(
    findings: Findings, where: str, info: MediaInfo, stretches: Iterable[tuple[float, float]]
) -> None:
    """Say where not all channels of a sound are heard as a voice."""
    found = {}
    for start, seconds in stretches:
        one = voice_channel(info, start, seconds)
        found[one.why] = one
    for why, said in WHY_NOT_ALL.items():
        if why in found:
            what = f"the {info.audio_channels} channels of {info.name} {said}"
            heard = f"channel {found[why].taken} is heard as the voice"
            findings.warn(f"{where}: {what}; {heard}")


def _bed(findings: Findings, at: KeyPath, dub: Dub, film: MediaInfo, *, speaks: bool) -> None:
    """Whether a scene can keep the channels of what lies under its voices.

    Args:
        speaks: whether somebody speaks in the film whom nobody dubs.
    """
    under = {"clip": film} if speaks or dub.music_effects is None else {}
    if dub.music_effects in findings.media:
        under["music_effects"] = music = findings.media[dub.music_effects]
        if music.audio_rate and abs(music.sound_seconds - film.duration) > OTHER_CUT:
            lasts = f"lasts {music.sound_seconds:.2f} s, the film {film.duration:.2f} s"
            findings.warn(f"{dub.name}: {music.path.name} {lasts}: is it of the same cut?")
    for key, info in under.items():
        if (info.audio_channels or 0) > MOST_CHANNELS:
            count = f"{info.audio_channels} channels in {info.name}"
            findings.add((*at, key), f"{count}: a scene takes {MOST_CHANNELS} at most; mix it down")


def _longer(findings: Findings, name: str, scene: Scene, film: MediaInfo) -> None:
    """Warn of speech that is longer than its film."""
    over = scene.length - (film.frames - scene.first)
    if over > 0 and scene.on_longer_audio in AT_THE_END:
        count = f"{over} frame{'s' * (over > 1)}"
        what = AT_THE_END[scene.on_longer_audio].format(count)
        longer = f"{name}: the speech is {float(over / film.rate):.2f} s longer than the film"
        policy = f"on_longer_audio: {scene.on_longer_audio}"
        findings.warn(f"{longer}: {what} ({policy})")


def of_tracks(findings: Findings, info: MediaInfo) -> None:
    """Say which of several tracks of a file are seen and heard."""
    if info.unseen_tracks:
        count = 1 + info.unseen_tracks
        findings.warn(f"{info.name}: of its {count} video tracks number 1 alone is seen")
    if info.primed:
        what = (
            "AAC in an AVI, or by itself, may be late by 20 to 50 ms; nothing in it says how many"
        )
        findings.warn(f"{info.name}: {what}; check that it is in sync, or give the recording")
    heard = [str(track + 1) for track in info.audio_tracks]
    if info.audio_rate is None or (len(heard) == 1 and not info.unheard_tracks):
        return
    total = len(heard) + info.unheard_tracks
    if len(heard) > 1:
        what = f"tracks {', '.join(heard)} of {total} are heard as the channels of one sound"
    else:
        what = f"of its {total} tracks of sound number {heard[0]} alone is heard"
    findings.warn(f"{info.name}: {what}")
