"""Measures a video block by block: the mouth of every face, and the sound.

A block is at most a minute, so memory does not grow with the length of the video. Faces keep
their number from block to block.

Letters: F frames of a block, M mouth points, R rows and C columns of a crop, T sound steps of
20 ms, D = 144 channels.
"""

import math
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from dfrf.field.speaker_adaptation import OPENING, TOUCHING
from dubbing import media
from dubbing.engine.disk.files import atomic_path, digest_bytes
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import ReportShare
from dubbing.face.finding.face_tracker import FaceTracker
from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS, mouth_crop
from dubbing.face.mouth.mouth_shape import MOUTH, mouth_shape
from dubbing.media.reading.late_frames import late_frames
from dubbing.sound_to_lips.predict import predict
from dubbing.speech.voice_activity import SAMPLE_RATE, energy_db, voice_activity
from dubbing.sync.kept_faces import KeptFaces
from dubbing.sync.network.channels import SoundChannels

BLOCK_SECONDS = 60.0
# Sound is read this far beyond a block: the largest offset that is searched, and a window.
MARGIN_SECONDS = 2.0
SILENT_DB = -120.0  # of full scale, the least that `energy_db` gives


@dataclass(frozen=True)
class Sound:
    """The sound of a block in steps of 20 ms, the first starting at `start`.

    Attributes:
        features: (T, D).
        heard: (T, 4): voice, loudness (dB above -120), the opening that the sound asks for, and a
            score of touching lips.
    """

    start: float
    features: np.ndarray
    heard: np.ndarray

    @classmethod
    def of(cls, start: float, samples: np.ndarray, channels: SoundChannels) -> "Sound":
        """The sound of samples (N,) at 16 kHz; features are normalised to their level."""
        lips = predict(lambda: [samples])[:, [OPENING, TOUCHING]]
        loudness = energy_db([samples]) - SILENT_DB
        heard = np.column_stack([voice_activity(samples), loudness, lips])
        return cls(start, channels.extract(samples), heard)

    @classmethod
    def read(cls, file: Path) -> "Sound":
        """Read the sound that `write` kept."""
        with np.load(file, allow_pickle=False) as kept:
            return cls(float(kept["start"]), kept["features"], kept["heard"])

    def write(self, file: Path) -> None:
        """Keep it in a file."""
        with atomic_path(file) as temporary:
            np.savez(temporary, start=self.start, features=self.features, heard=self.heard)


@dataclass
class BlockFace:
    """One face in one block.

    Attributes:
        shapes: of its mouth (F, M, 2), NaN without a face.
        crops: pixels of its mouth (F, R, C) uint8, 0 without a face.
        size: width and height of a frame, px.
        places: middle of the face (2,) px in each frame that shows it.
    """

    shapes: np.ndarray
    crops: np.ndarray
    size: tuple[int, int]
    places: list[np.ndarray] = field(default_factory=list)

    @classmethod
    def empty(cls, frames: int, size: tuple[int, int]) -> "BlockFace":
        shapes = np.full((frames, len(MOUTH), 2), np.nan, np.float32)
        return cls(shapes, np.zeros((frames, ROWS, COLUMNS), np.uint8), size)

    def add(self, k: int, points: np.ndarray, crop: np.ndarray, face: np.ndarray) -> None:
        """Add frame k with the mesh (478, 3) of the face, and the crop (R, C) of its mouth."""
        self.shapes[k] = mouth_shape(points[None], face)[0]
        self.crops[k] = crop
        self.places.append((points[:, :2].min(0) + points[:, :2].max(0)) / 2)

    @property
    def centre(self) -> tuple[float, float]:
        """Its median position: column and row as shares of the frame."""
        column, row = np.median(self.places, axis=0)
        return float(column / self.size[0]), float(row / self.size[1])


@dataclass(frozen=True)
class Block:
    first: int
    frames: int
    rate: Fraction
    faces: dict[int, BlockFace]
    sound: Sound

    @property
    def times(self) -> np.ndarray:
        """Middle of every frame in seconds of the file, (F,)."""
        return (self.first + np.arange(self.frames) + 0.5) / float(self.rate)


def block_lengths(frames: int, rate: Fraction) -> list[int]:
    """Lengths of equal blocks of at most `BLOCK_SECONDS`."""
    count = max(1, -(-frames // int(rate * Fraction(BLOCK_SECONDS))))
    edges = [round(frames * k / count) for k in range(count + 1)]
    return [b - a for a, b in pairwise(edges)]


def measure_sound(
    path: Path,
    start: float,
    seconds: float,
    channels: SoundChannels,
    end: float = math.inf,
    pieces: Pieces | None = None,
) -> Sound:
    """Sound of a part of a file, up to ``end``; see `check`."""
    begin = max(0.0, start - MARGIN_SECONDS)
    samples = media.read_audio(
        path,
        rate=SAMPLE_RATE,
        start=begin,
        seconds=min(end, start + seconds + MARGIN_SECONDS) - begin,
    )
    if pieces is None:
        return Sound.of(begin, samples, channels)
    name = f"sound/{begin:.3f}.npz"
    if not pieces.take(name, [begin, digest_bytes(samples.tobytes())]):
        Sound.of(begin, samples, channels).write(pieces.out / name)
    return Sound.read(pieces.out / name)


def measure(
    video: Path,
    face: np.ndarray,
    *,
    sound_from: Path | None = None,
    leave_out: int = 0,
    span: tuple[int, int] | None = None,
    progress: ReportShare | None = None,
    pieces: Pieces | None = None,
) -> Iterator[Block]:
    """Blocks of a video from its beginning to its end.

    Args:
        video: to measure.
        face: canonical face (K, 3) that meshes are aligned to (`SyncNetwork.face`).
        sound_from: another file to take the sound from, starting together.
        leave_out: frames at the end whose picture and sound are ignored.
        span: frames first .. stop; blocks that hold none of them are left out. All by default.
        progress: called with the share done, 0..1.
        pieces: see `check`.

    Raises:
        MediaError: no picture or no sound, or the file cannot be read.
    """
    info = media.probe(video)
    rate, total = info.rate, info.frames - leave_out
    end = total / float(rate) if leave_out else math.inf
    images = late_frames(video, keyed=pieces is not None)
    channels = SoundChannels()
    first = 0
    tracker = FaceTracker(float(rate))
    begin, stop = span or (0, total)
    for length in block_lengths(total, rate):
        if first + length <= begin or first >= stop:
            deque(islice(images, length), 0)  # no image is decoded that is not asked for
            first += length
            continue
        faces: dict[int, BlockFace] = {}
        known, found = KeptFaces(), KeptFaces()
        kept = f"faces/{first:06d}.npz"
        if pieces is not None and pieces.same(kept, [""]) == [True] and pieces.last is not None:
            known = KeptFaces.read(pieces.last / kept)
        place = first / float(rate), length / float(rate)
        with ThreadPoolExecutor(1) as beside:
            heard = (sound_from or video, *place, channels, end, pieces)
            sound = beside.submit(measure_sound, *heard)
            some = islice(images, length)
            meshes = None if pieces is None else found.meshes
            for k, (frame, key, tracked) in enumerate(tracker(some, known.meshes, meshes)):
                for number, detected in enumerate(tracked):
                    if detected.track not in faces:
                        faces[detected.track] = BlockFace.empty(length, (info.width, info.height))
                    mouth = f"{key} {number}"
                    crop = known.mouths.get(mouth)
                    if crop is None:
                        crop = mouth_crop(frame.image, detected.points, face)
                    found.mouths[mouth] = crop
                    faces[detected.track].add(k, detected.points, crop, face)
                if progress is not None:
                    progress(min(max(0.0, (first + k + 1 - begin) / (stop - begin)), 1.0))
        if pieces is not None:
            found.write(pieces.out / kept)
        yield Block(first, length, rate, faces, sound.result())
        first += length
