"""What a video shows and says: mouth shapes of every face, and the sound, block by block.

A block is at most a minute, so memory does not grow with the length of the video. Faces keep
their number from block to block.

Letters: F frames of a block, M mouth points, T sound steps of 20 ms, D = 144 channels.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.errors import MediaError
from dubbing.sync.faces import track_faces
from dubbing.sync.hearing import Hearing
from dubbing.sync.mouth import MOUTH, mouth_shape
from dubbing.voice import SAMPLE_RATE, voice_activity

BLOCK_SECONDS = 60.0
# Sound is read this far beyond a block: the largest offset that is searched, and a window.
MARGIN_SECONDS = 2.0


@dataclass(frozen=True)
class Sound:
    """A piece of sound: features and voice in steps of 20 ms, the first one starting at `start`."""

    start: float
    heard: np.ndarray  # (T, D)
    voice: np.ndarray  # (T,)


@dataclass(frozen=True)
class SeenFace:
    """One face in one block: mouth shapes (F, M, 2), NaN where unseen, and where it mostly is."""

    shapes: np.ndarray
    centre: tuple[float, float]  # column and row as shares of the picture
    width: float  # of the face, pixels


@dataclass(frozen=True)
class Block:
    first: int
    frames: int
    rate: Fraction
    faces: dict[int, SeenFace]
    sound: Sound

    @property
    def times(self) -> np.ndarray:
        """Middle of every frame in seconds of the file, (F,)."""
        return (self.first + np.arange(self.frames) + 0.5) / float(self.rate)


def block_lengths(frames: int, rate: Fraction) -> list[int]:
    """Frames cut into equal blocks of at most `BLOCK_SECONDS`."""
    count = max(1, -(-frames // int(rate * Fraction(BLOCK_SECONDS))))
    edges = [round(frames * k / count) for k in range(count + 1)]
    return [b - a for a, b in pairwise(edges)]


def measure_sound(path: Path, start: float, seconds: float, hearing: Hearing) -> Sound:
    """Sound of a stretch of a file; the features' level is that of the stretch."""
    begin = max(0.0, start - MARGIN_SECONDS)
    samples = media.read_audio(
        path, rate=SAMPLE_RATE, start=begin, seconds=start + seconds + MARGIN_SECONDS - begin
    )
    return Sound(begin, hearing(samples), voice_activity(samples))


def measure(
    video: Path,
    face: np.ndarray,
    *,
    sound_from: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Iterator[Block]:
    """Blocks of a video from its beginning to its end.

    Args:
        video: the pictures.
        face: canonical face (K, 3) the mouths are laid on (`SyncNetwork.face`).
        sound_from: another file to take the sound from, beginning together.
        progress: called with the share done, 0..1.

    Raises:
        MediaError: no picture or no sound, or the file cannot be read.
    """
    info = media.probe(video)
    if info.rate is None:
        raise MediaError("no picture in it", str(video))
    rate, total = info.rate, info.frames
    pictures = media.read_frames(video)
    tracked = track_faces(pictures, float(rate))
    hearing = Hearing()
    first = 0
    for length in block_lengths(total, rate):
        shapes: dict[int, np.ndarray] = {}
        places: dict[int, list[np.ndarray]] = defaultdict(list)
        for k, faces in enumerate(islice(tracked, length)):
            for seen in faces:
                if seen.track not in shapes:
                    shapes[seen.track] = np.full((length, len(MOUTH), 2), np.nan, np.float32)
                shapes[seen.track][k] = mouth_shape(seen.points[None], face)[0]
                low, high = seen.points[:, :2].min(0), seen.points[:, :2].max(0)
                places[seen.track].append(np.array([*(low + high) / 2, high[0] - low[0]]))
            if progress is not None:
                progress((first + k + 1) / total)
        size = np.array([info.width, info.height, 1.0])
        middle = {t: np.median(p, axis=0) / size for t, p in places.items()}
        found = {
            t: SeenFace(s, (float(middle[t][0]), float(middle[t][1])), float(middle[t][2]))
            for t, s in shapes.items()
        }
        start, seconds = first / float(rate), length / float(rate)
        sound = measure_sound(sound_from or video, start, seconds, hearing)
        yield Block(first, length, rate, found, sound)
        first += length
