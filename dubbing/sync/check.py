"""The sync check: offset between the sound and the mouth of a video, and how well they fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.engine.stage import ReportShare
from dubbing.speech.voice_activity import STEP_RATE, at_times
from dubbing.sync.curves import MAX_OFFSET, CurveSum, distances, estimate
from dubbing.sync.embeddings import mouth_embeddings, sound_embeddings
from dubbing.sync.judgement import Measurement, conclude, judge_part, reference_confidence
from dubbing.sync.measure import Block, measure
from dubbing.sync.motion import MotionSum
from dubbing.sync.result import FaceResult, Media, Segment, SyncResult
from dubbing.sync.sync_network import SyncNetwork, load_network

METHOD = "lip geometry and mouth pixels against log-mel and speech features, two streams"
SEGMENT_SECONDS = 5.0
# A last segment shorter than this is joined to the one before.
SHORTEST_SEGMENT = 3.0
# Weight of a frame without voice; one in full speech has 1 more. A closed mouth in silence is
# evidence, too, but a long silence must not outweigh the rest.
SILENT_WEIGHT = 0.2
# A segment or a face needs this many compared frames to have an offset of its own.
MIN_ROWS = 40
Parts = Sequence[tuple[int, int]]


@dataclass
class _FaceSum:
    """Sums for one face over the whole video."""

    whole: CurveSum
    parts: list[CurveSum]
    motion: MotionSum
    place: np.ndarray
    frames: int = 0

    @classmethod
    def empty(cls, segments: int, rate: float) -> "_FaceSum":
        parts = [CurveSum.empty() for _ in range(segments)]
        return cls(CurveSum.empty(), parts, MotionSum(rate), np.zeros(2))

    @property
    def evidence(self) -> float:
        """Grows with the confidence and with the duration (noise falls as 1 / sqrt)."""
        return _evidence(self.whole)


def _evidence(total: CurveSum) -> float:
    best = estimate(total.curve())
    return best.confidence * total.rows**0.5 if best is not None else 0.0


class _Sums:
    """All sums over the blocks of one video."""

    def __init__(self, network: SyncNetwork, info: media.MediaInfo, parts: Parts | None) -> None:
        self._network = network
        self.rate = float(info.rate)
        self.apart = parts is not None
        edges = segment_edges(info.frames, self.rate).tolist()
        self.parts = parts if parts is not None else [*pairwise(edges)]
        self.part_of = np.full(info.frames, -1)  # of the frames that count
        for k, (first, stop) in enumerate(self.parts):
            self.part_of[first:stop] = k
        self.faces: dict[int, _FaceSum] = {}
        self.voice = np.zeros(len(self.parts))

    def add(self, block: Block) -> None:
        times = block.times - block.sound.start
        around = (np.arange(-MAX_OFFSET, block.frames + MAX_OFFSET) + 0.5) / self.rate + (
            block.first / self.rate - block.sound.start
        )
        sounds = sound_embeddings(self._network, block.sound.features, around)
        frame = block.first + np.arange(-MAX_OFFSET, block.frames + MAX_OFFSET)
        beyond = around >= len(block.sound.features) / STEP_RATE
        sounds[(frame < 0) | beyond] = np.nan
        voice = at_times(block.sound.voice, times)
        part = self.part_of[block.first : block.first + block.frames]
        counts = part >= 0
        self.voice += np.bincount(part[counts], voice[counts], len(self.voice))
        for track, face in block.faces.items():
            if track not in self.faces:
                self.faces[track] = _FaceSum.empty(len(self.voice), self.rate)
            total = self.faces[track]
            mouth = mouth_embeddings(self._network, face.shapes, face.crops, times)
            rows = distances(mouth, sounds)
            weights = SILENT_WEIGHT + voice
            total.whole.add(rows[counts], weights[counts])
            for s in np.unique(part[counts]):
                chosen = part == s
                total.parts[s].add(rows[chosen], weights[chosen])
            total.motion.add(np.where(counts[:, None, None], face.shapes, np.nan), voice)
            frames = int(np.isfinite(face.shapes[counts, 0, 0]).sum())
            total.place += frames * np.array(face.centre)
            total.frames += frames


def segment_edges(frames: int, rate: float) -> np.ndarray:
    """First frames of the 5 s segments, and the number of frames at the end."""
    edges = [
        round(k * SEGMENT_SECONDS * rate) for k in range(int(frames / rate / SEGMENT_SECONDS) + 1)
    ]
    edges = [e for e in edges if e < frames] + [frames]
    if len(edges) > 2 and edges[-1] - edges[-2] < SHORTEST_SEGMENT * rate:
        del edges[-2]
    return np.array(edges)


def _segments(sums: _Sums, speaker: _FaceSum, reference: float | None) -> list[Segment]:
    """Results of the parts: for the speaker, or in requested parts for the face that speaks."""
    segments = []
    for k, (first, stop) in enumerate(sums.parts):
        faces = [face.parts[k] for face in sums.faces.values()] if sums.apart else []
        part = max(faces, key=_evidence, default=speaker.parts[k])
        best = estimate(part.curve()) if part.rows >= MIN_ROWS else None
        voice = float(sums.voice[k] / (stop - first))
        length = (stop - first) / sums.rate
        segments.append(
            Segment(
                float(first / sums.rate),
                float(stop / sums.rate),
                best.offset if best else None,
                best.confidence if best else None,
                best.distance if best else None,
                voice,
                *judge_part(best, sums.rate, length, voice, reference),
            )
        )
    return segments


def _faces(sums: _Sums) -> list[FaceResult]:
    results = []
    for track, face in sorted(sums.faces.items(), key=lambda item: -item[1].evidence):
        best = estimate(face.whole.curve()) if face.whole.rows >= MIN_ROWS else None
        column, row = face.place / max(face.frames, 1)
        results.append(
            FaceResult(
                track,
                float(column),
                float(row),
                face.frames / sums.rate,
                best.offset if best else None,
                best.confidence if best else None,
            )
        )
    return results


def check(
    video: Path,
    *,
    source: SyncResult | None = None,
    sound_from: Path | None = None,
    parts: Parts | None = None,
    leave_out: int = 0,
    progress: ReportShare | None = None,
) -> SyncResult:
    """Lip sync of a video, of any length, size, rate and number of faces.

    Frames are those of the video: at 60 fps the search covers 15 frames = 250 ms to each side.

    Args:
        video: with picture and sound.
        source: result of the clip that the video was made from, to compare the confidence with.
        sound_from: another file to take the sound from, starting together with the video.
        parts: the only frames (first, stop) to check; they become the segments, unless they are
            the whole video.
        leave_out: frames at the end whose picture and sound are ignored.
        progress: called with the share done, 0..1.

    Raises:
        MediaError: the file is missing, unreadable or has no picture.
    """
    info = media.probe(video)
    info = replace(info, frames=info.frames - leave_out)
    if parts is not None and [*parts] == [(0, info.frames)]:
        parts = None
    sound = info if sound_from is None else media.probe(sound_from)
    if sound.audio_rate is None:
        facts = Media(info.frames, str(info.rate), info.duration, 0.0, 0.0, 0.0)
        return SyncResult("unjudged", "no sound in it", METHOD, facts, source=source)
    network = load_network()
    sums = _Sums(network, info, parts)
    for block in measure(
        video, network.face.numpy(), sound_from=sound_from, leave_out=leave_out, progress=progress
    ):
        sums.add(block)
    speaker = max(sums.faces.values(), key=lambda f: f.evidence, default=None)
    heard = info.frames / sums.rate if leave_out else sound.sound_seconds
    facts = Media(
        frames=info.frames,
        rate=str(info.rate),
        picture_seconds=min(info.duration, sum(b - a for a, b in sums.parts) / sums.rate),
        sound_seconds=min(sound.sound_seconds, heard),
        speech_seconds=float(sums.voice.sum() / sums.rate),
        mouth_seconds=speaker.whole.rows / sums.rate if speaker else 0.0,
    )
    best = estimate(speaker.whole.curve()) if speaker else None
    measured = None
    if speaker is not None and best is not None:
        faces = _faces(sums)
        reference = reference_confidence(source, METHOD)
        measured = Measurement(
            best,
            speaker.whole.curve().tolist(),
            sums.rate,
            faces[0].track,
            speaker.motion.result(),
            _segments(sums, speaker, reference),
            faces,
        )
    return conclude(measured, METHOD, facts, source, tracked=bool(sums.faces))
