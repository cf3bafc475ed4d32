"""Training data of the sync network: mouths and sounds of whole clips of talking people.

Letters: F frames, M mouth points, R rows and C columns of a crop, N samples at 16 kHz, T sound
steps of 20 ms, D = 144 channels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.engine.disk.files import atomic_path
from dubbing.errors import SyncError
from dubbing.face.finding.face_tracker import POINTS, track_faces
from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS, mouth_crops
from dubbing.face.mouth.mouth_shape import mouth_shape
from dubbing.speech.voice_activity import SAMPLE_RATE, voice_activity
from dubbing.sync.network.channels import SoundChannels
from dubbing.workshop.training.sync.takes import Take, another_take

KEPT = frozenset({"meshes", "times", "samples", "voice"})  # of a recording, in a file


@dataclass(frozen=True)
class Recording:
    """One clip as measured: the largest face's mesh (F, 478, 3) at `times` (F,), and its sound."""

    path: Path
    meshes: np.ndarray
    times: np.ndarray
    samples: np.ndarray  # (N,)
    voice: np.ndarray  # (T,)


@dataclass(frozen=True)
class TalkingClip:
    """Mouth shapes (F, M, 2) at `times` (F,), and the sound (T, D) that belongs `offset` s later.

    `crops` (F, R, C) are the mouth's pixels, none where nobody looks at them. `takes` are other
    recordings of the same sound, to learn from. `exact`: the synthetic speaker's, whose offset is
    0 by making.
    """

    name: str
    shapes: np.ndarray
    times: np.ndarray
    sound: np.ndarray
    voice: np.ndarray
    offset: float = 0.0
    takes: tuple[Take, ...] = ()
    exact: bool = False
    crops: np.ndarray = field(default_factory=lambda: np.zeros((0, ROWS, COLUMNS), np.uint8))


def record(path: Path) -> Recording:
    """Measures one clip of one talking person.

    Raises:
        MediaError: the clip has no picture or no sound.
        SyncError: no face is found in half of it.
    """
    info = media.probe(path)
    if info.picture is None:
        raise SyncError("no picture in it", str(path), "give a video of a talking person")
    meshes = np.full((info.frames, POINTS, 3), np.nan, np.float32)
    for k, faces in enumerate(track_faces(media.read_frames(path), float(info.rate))):
        if faces:
            meshes[k] = max(faces, key=lambda f: float(np.ptp(f.points[:, 0]))).points
    if np.isfinite(meshes[:, 0, 0]).mean() < 0.5:
        raise SyncError("no face in most of it", str(path), "leave this clip out")
    sound = media.read_audio(path, rate=SAMPLE_RATE)
    times = (np.arange(info.frames) + 0.5) / float(info.rate)
    return Recording(path, meshes, times, sound, voice_activity(sound))


def recorded(path: Path, cache: Path | None) -> Recording:
    """`record`, kept in the folder `cache` under the clip's name, or taken from there."""
    if cache is None:
        return record(path)
    kept = cache / f"{path.stem}.npz"
    if kept.exists():
        with np.load(kept) as arrays:
            if set(arrays.files) == KEPT:  # else it was kept by another version
                return Recording(path, **arrays)
    new = record(path)
    with atomic_path(kept) as temporary:
        np.savez(temporary, **{name: getattr(new, name) for name in KEPT})
    return new


def laid_on(
    recordings: Sequence[Recording],
    face: np.ndarray,
    *,
    takes: int = 0,
    seed: int = 0,
    exact: bool = False,
    pixels: bool = True,
) -> list[TalkingClip]:
    """Clips with their mouths laid on a canonical face (K, 3); frames without a face left out.

    Args:
        takes: how many other takes of each sound to make.
        exact: whether they show the synthetic speaker.
        pixels: whether to cut out the mouths as well, for which the clips are read again.
    """
    channels, rng = SoundChannels(), np.random.default_rng(seed)
    clips = []
    for r in recordings:
        shapes = mouth_shape(r.meshes, face)
        visible = np.isfinite(shapes).all((1, 2))
        others = tuple(another_take(r.samples, channels, rng) for _ in range(takes))
        name, sound = r.path.stem, channels.extract(r.samples)
        clip = TalkingClip(name, shapes[visible], r.times[visible], sound, r.voice, exact=exact)
        if pixels:
            crops = mouth_crops(media.read_frames(r.path), r.meshes, face)
            clip = replace(clip, crops=crops[visible])
        clips.append(replace(clip, takes=others))
    return clips
