"""The published SyncNet's check: its crop, its arithmetic, its offset, confidence and distance.

Needs `syncnet_v2.model` on the user's disk. One thing differs from the published scripts: the face
box comes from the face mesh, not from S3FD, so figures of a video agree closely, not exactly; the
arithmetic from windows to offset is theirs to rounding.

Letters: n windows of 5 frames, E = 1024, K = 31 shifts, T frames.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import torch
from scipy.ndimage import median_filter
from torch import Tensor

from dubbing import media
from dubbing.face.finding.face_tracker import track_faces
from dubbing.speech.voice_activity import STEP_RATE, voice_activity_of_blocks
from dubbing.sync.curves import MAX_OFFSET, Estimate
from dubbing.sync.judgement import Measurement, conclude
from dubbing.sync.result import Media, SyncResult
from dubbing.workshop.lab.syncnet.mfcc import HOP, SAMPLE_RATE, WINDOW, mfcc
from dubbing.workshop.lab.syncnet.syncnet_network import (
    EMBEDDING,
    FRAMES,
    SIDE,
    STEPS,
    PublishedSyncNet,
    load_published,
)

RATE = Fraction(25)
METHOD = "published SyncNet"
# Confidence of the published network for talking heads in sync; its own demo clip has 10.0.
TYPICAL_CONFIDENCE = 6.0
SAMPLES_PER_FRAME = SAMPLE_RATE // int(RATE)
STEPS_PER_FRAME = SAMPLES_PER_FRAME // HOP
CROP_SCALE = 0.4
GREY = 110
BOX_MEDIAN = 13
EPSILON = 1e-6
# Windows embedded at once.
BATCH = 10
# Sound is read for this many windows at a time: a whole number of batches.
SOUND_BATCH = 50 * BATCH


def windows_of(frames: int, samples: int) -> int:
    """Number of windows n of a video of so many frames at 25 fps and samples at 16 kHz."""
    return max(0, min(frames, samples // SAMPLES_PER_FRAME) - FRAMES)


def shift_rows(mouth: Tensor, sound: Tensor) -> Tensor:
    """Distances of m mouth windows to the sound at every shift, (m, K).

    Args:
        mouth: (m, E).
        sound: (m + 30, E): from 15 windows earlier to 15 later, zero rows beyond the ends.

    Column j is the sound window j - 15 later; distance = |mouth - sound + 1e-6|.
    """
    columns = [sound[j : j + len(mouth)] for j in range(2 * MAX_OFFSET + 1)]
    return torch.stack([torch.linalg.norm(mouth - c + EPSILON, dim=1) for c in columns], dim=1)


def published_estimate(curve: Tensor) -> Estimate:
    """Offset = 15 - argmin, confidence = median - minimum, and the minimum, of a curve (K,)."""
    distance, best = curve.min(0)
    confidence = curve.median() - distance
    return Estimate(MAX_OFFSET - int(best), float(confidence), float(distance))


def face_boxes(boxes: np.ndarray) -> np.ndarray:
    """Centre and half size (column, row, s) in every frame, (T, 3), from `boxes` with gaps (NaN).

    Gaps are interpolated; a running median over 13 frames removes jitter.
    """
    place = np.arange(len(boxes))
    known = np.flatnonzero(np.isfinite(boxes[:, 0]))
    filled = [np.interp(place, known, boxes[known, k]) for k in range(3)]
    return np.stack([median_filter(f, BOX_MEDIAN, mode="nearest") for f in filled], axis=1)


def track_boxes(video: Path, frames: int) -> dict[int, np.ndarray]:
    """Boxes (T, 3) at 25 fps of every face tracked half of the time, NaN where it is not."""
    tracks: dict[int, np.ndarray] = {}
    images = media.read_frames(video, rate=RATE, count=frames)
    for k, faces in enumerate(track_faces(images, float(RATE))):
        for face in faces:
            low, high = face.points[:, :2].min(0), face.points[:, :2].max(0)
            boxes = tracks.setdefault(face.track, np.full((frames, 3), np.nan))
            boxes[k] = [*(low + high) / 2, (high - low).max() / 2]
    half = 0.5 * frames
    return {t: b for t, b in tracks.items() if np.isfinite(b[:, 0]).sum() >= half}


def crop_face(frame: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Face crop (224, 224, 3) BGR uint8 of an RGB frame: lower than the box, padded with grey."""
    column, row, half = (float(v) for v in box)
    pad = int(half * (1 + 2 * CROP_SCALE))
    grey = cv2.copyMakeBorder(frame, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=(GREY,) * 3)
    column, row = column + pad, row + pad
    rows = slice(int(row - half), int(row + half * (1 + 2 * CROP_SCALE)))
    columns = slice(int(column - half * (1 + CROP_SCALE)), int(column + half * (1 + CROP_SCALE)))
    return cv2.cvtColor(cv2.resize(grey[rows, columns], (SIDE, SIDE)), cv2.COLOR_RGB2BGR)


@torch.no_grad()
def embed_frames(network: PublishedSyncNet, crops: Iterable[np.ndarray]) -> Iterator[Tensor]:
    """Mouth embeddings, up to 10 windows at a time, of face crops (224, 224, 3) in order."""
    kind = next(network.parameters()).dtype
    held: list[np.ndarray] = []

    def embedded() -> Tensor:
        stack = torch.from_numpy(np.stack(held)).permute(3, 0, 1, 2).to(kind)
        count = len(held) - FRAMES + 1
        return network.embed_mouth(torch.stack([stack[:, k : k + FRAMES] for k in range(count)]))

    for crop in crops:
        held.append(crop)
        if len(held) == BATCH + FRAMES - 1:
            yield embedded()
            held = held[BATCH:]
    if len(held) >= FRAMES:
        yield embedded()


@torch.no_grad()
def embed_cepstra(network: PublishedSyncNet, cepstra: Tensor) -> Tensor:
    """Sound embeddings (m, E) of cepstra (>= 4 m + 16 steps, 13): window i has steps 4i..4i+19."""
    count = (len(cepstra) - STEPS) // STEPS_PER_FRAME + 1
    parts = [cepstra[STEPS_PER_FRAME * i :][:STEPS].T[None] for i in range(count)]
    return network.embed_sound(torch.stack(parts))


def _sound_rows(network: PublishedSyncNet, path: Path, first: int, last: int, n: int) -> Tensor:
    """Sound embeddings of the windows first..last - 1, zero rows outside 0..n - 1."""
    low, high = max(first, 0), min(last, n)
    # One step earlier, so that pre-emphasis has the sample before; that step is dropped.
    lead = HOP if low else 0
    begin = low * SAMPLES_PER_FRAME - lead
    steps = STEPS_PER_FRAME * (high - low - 1) + STEPS
    seconds = (lead + (steps - 1) * HOP + WINDOW) / SAMPLE_RATE
    samples = media.read_audio(path, rate=SAMPLE_RATE, start=begin / SAMPLE_RATE, seconds=seconds)
    integers = np.clip(np.round(samples * 32768), -32768, 32767)
    cepstra = torch.from_numpy(mfcc(integers)[lead // HOP :][:steps]).float()
    rows = torch.zeros(last - first, EMBEDDING)
    rows[low - first : high - first] = embed_cepstra(network, cepstra)
    return rows


def published_measure(
    network: PublishedSyncNet, video: Path, boxes: np.ndarray
) -> tuple[Estimate, np.ndarray] | None:
    """Estimate and curve over OFFSETS of a video with face boxes (T, 3) at 25 fps.

    None if it is too short for a window. Memory does not grow with the length.
    """
    samples = sum(len(block) for block in media.iter_audio(video, rate=SAMPLE_RATE))
    n = windows_of(len(boxes), samples)
    if n == 0:
        return None
    frames = media.read_frames(video, rate=RATE, count=n + FRAMES - 1)
    crops = (crop_face(frame, box) for frame, box in zip(frames, boxes, strict=False))
    total = torch.zeros(2 * MAX_OFFSET + 1, dtype=torch.float64)
    mouths = embed_frames(network, crops)
    for first in range(0, n, SOUND_BATCH):
        sound = _sound_rows(
            network, video, first - MAX_OFFSET, min(first + SOUND_BATCH, n) + MAX_OFFSET, n
        )
        for mouth in islice(mouths, SOUND_BATCH // BATCH):
            total += shift_rows(mouth, sound[: len(mouth) + 2 * MAX_OFFSET]).double().sum(0)
            sound = sound[len(mouth) :]
    curve = total / n
    # Column j of the published curve is offset 15 - j; ours runs the other way.
    return published_estimate(curve), curve.flip(0).numpy()


def published_check(video: Path, weights: Path) -> SyncResult:
    """The published SyncNet's figures for a video, and our verdict on them.

    Of several faces the one with the highest confidence counts. Offsets are frames at 25 fps.

    Raises:
        SyncError: the weights are missing or no SyncNet.
        MediaError: the video is missing, unreadable or has no picture.
    """
    network = load_published(weights)
    info = media.probe(video)
    frames = round(info.duration * RATE)
    facts = Media(info.frames, str(info.rate), info.duration, info.sound_seconds, 0.0, 0.0)
    if info.audio_rate is None:
        return SyncResult("unjudged", "no sound in it", METHOD, facts)
    voice = voice_activity_of_blocks(media.sound_blocks(video, rate=SAMPLE_RATE))
    tracks = track_boxes(video, frames)
    measured = {}
    for track, boxes in tracks.items():
        one = published_measure(network, video, face_boxes(boxes))
        if one is not None:
            measured[track] = one
    speaker = max(measured, key=lambda t: measured[t][0].confidence, default=None)
    count = int(np.isfinite(tracks[speaker][:, 0]).sum()) if speaker is not None else 0
    facts = replace(
        facts, speech_seconds=float(voice.sum() / STEP_RATE), mouth_seconds=float(count / RATE)
    )
    result = None
    if speaker is not None:
        best, curve = measured[speaker]
        result = Measurement(best, curve.tolist(), float(RATE), speaker)
    tracked = bool(tracks)
    return conclude(result, METHOD, facts, None, tracked=tracked, typical=TYPICAL_CONFIDENCE)
