"""Sums over a video for each face: curves of distance, and what its mouth does.

Letters: F frames of the video, K = 31 offsets.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from dubbing import media
from dubbing.speech.voice_activity import STEP_RATE, at_times
from dubbing.sync.closeness import Closeness, closeness
from dubbing.sync.curves import MAX_OFFSET, CurveSum, distances, early_ms, estimate
from dubbing.sync.measure import Block
from dubbing.sync.mouth_figures import MouthSeries, mouth_figures, of_mouth
from dubbing.sync.network.embeddings import mouth_embeddings, sound_embeddings
from dubbing.sync.network.sync_network import SyncNetwork
from dubbing.sync.result import FaceResult, Figures

SEGMENT_SECONDS = 5.0
# A last segment shorter than this is joined to the one before.
SHORTEST_SEGMENT = 3.0
# Weight of a frame without voice; one in full speech has 1 more. A closed mouth in silence is
# evidence, too, but a long silence must not outweigh the rest.
SILENT_WEIGHT = 0.2
Parts = Sequence[tuple[int, int]]


@dataclass
class FaceSum:
    """Sums for one face over the whole video.

    Attributes:
        mouth: of the blocks that it is in, by their first frames, as of `of_mouth`.
    """

    whole: CurveSum
    parts: list[CurveSum]
    place: np.ndarray
    frames: int = 0
    mouth: dict[int, np.ndarray] = field(default_factory=dict)

    @classmethod
    def empty(cls, segments: int) -> "FaceSum":
        return cls(CurveSum.empty(), [CurveSum.empty() for _ in range(segments)], np.zeros(2))

    @property
    def centre(self) -> tuple[float, float]:
        """Mean column and row, shares of the frame."""
        column, row = self.place / max(self.frames, 1)
        return float(column), float(row)


def evidence(total: CurveSum) -> float:
    """Grows with the confidence and with the duration (noise falls as 1 / sqrt)."""
    best = estimate(total.curve()) if total.rows else None
    return best.confidence * total.rows**0.5 if best is not None else 0.0


class Sums:
    """All sums over the blocks of one video."""

    def __init__(self, network: SyncNetwork, info: media.MediaInfo, parts: Parts | None) -> None:
        self._network = network
        self.rate = float(info.rate)
        self.apart = parts is not None
        edges = segment_edges(info.frames, self.rate)
        self.parts = parts if parts is not None else [*pairwise(edges)]
        self.part_of = np.full(info.frames, -1)  # of the frames that count
        for k, (first, stop) in enumerate(self.parts):
            self.part_of[first:stop] = k
        self.faces: dict[int, FaceSum] = {}
        self.voice = np.zeros(len(self.parts))
        self.sound = np.zeros((4, info.frames))  # as of `Sound.heard`, at the frames

    def add(self, block: Block, lag: float) -> None:
        """Add a block whose sound is heard `lag` seconds later than it lies in its file."""
        times = block.times - block.sound.start - lag
        around = (np.arange(-MAX_OFFSET, block.frames + MAX_OFFSET) + 0.5) / self.rate + (
            block.first / self.rate - block.sound.start - lag
        )
        sounds = sound_embeddings(self._network, block.sound.features, around)
        frame = block.first + np.arange(-MAX_OFFSET, block.frames + MAX_OFFSET)
        beyond = around >= len(block.sound.features) / STEP_RATE
        sounds[(frame < 0) | beyond] = np.nan
        here = slice(block.first, block.first + block.frames)
        self.sound[:, here] = at_times(block.sound.heard, times).T
        voice, part = self.sound[0, here], self.part_of[here]
        counts = part >= 0
        self.voice += np.bincount(part[counts], voice[counts], len(self.voice))
        for track, face in block.faces.items():
            if track not in self.faces:
                self.faces[track] = FaceSum.empty(len(self.voice))
            total = self.faces[track]
            mouth = mouth_embeddings(self._network, face.shapes, face.crops, times)
            rows = distances(mouth, sounds)
            weights = SILENT_WEIGHT + voice
            total.whole.add(rows[counts], weights[counts])
            for s in np.unique(part[counts]):
                chosen = part == s
                total.parts[s].add(rows[chosen], weights[chosen])
            total.mouth[block.first] = of_mouth(face.shapes, face.crops, self.rate)
            frames = int(np.isfinite(face.shapes[counts, 0, 0]).sum())
            total.place += frames * np.array(face.centre)
            total.frames += frames

    def figures(
        self, face: FaceSum, chosen: np.ndarray, total: CurveSum, offset: int
    ) -> Figures | None:
        """Figures of a face in chosen frames, with their curve."""
        mouth = np.full((3, len(self.part_of)), np.nan)
        for first, block in face.mouth.items():
            mouth[:, first : first + block.shape[1]] = block
        series = MouthSeries(self.rate, *mouth, *self.sound)
        return mouth_figures(series, chosen, total.curve(), offset)

    def near(
        self, face: FaceSum, chosen: np.ndarray, total: CurveSum, film: FaceResult | None
    ) -> Closeness | None:
        """Closeness of a face in chosen frames to a face of the film."""
        found = self.figures(face, chosen, total, 0)
        if found is None or film is None or film.figures is None:
            return None
        return closeness(found, film.figures, early_ms(total.curve(), self.rate))

    def speaking(self) -> np.ndarray:
        """Which of the faces follows the sound best in each frame, (F,): its place among them."""
        table = np.array([[evidence(part) for part in face.parts] for face in self.faces.values()])
        return np.where(self.part_of >= 0, table.argmax(0)[self.part_of], -1)


def segment_edges(frames: int, rate: float) -> list[int]:
    """First frames of the 5 s segments, and the number of frames at the end."""
    edges = [
        round(k * SEGMENT_SECONDS * rate) for k in range(int(frames / rate / SEGMENT_SECONDS) + 1)
    ]
    edges = [e for e in edges if e < frames] + [frames]
    if len(edges) > 2 and edges[-1] - edges[-2] < SHORTEST_SEGMENT * rate:
        del edges[-2]
    return edges
