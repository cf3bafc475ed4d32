"""Chooses the seconds of a person's clips to fine-tune on: those with the most views and sounds.

T frames of a clip, F frames that are chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch

from dubbing.face.mouth.lip_measures import lip_measures
from dubbing.identity.clip_frames import ClipFrames
from dubbing.identity.dataset import eye_boxes
from dubbing.identity.sharpness import gradient_energy
from dubbing.media import read_frames
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking import cropping
from dubbing.sound_to_lips.speech_frames import SpeechFrames

PIECE = 3.0  # seconds, about: shorter ones cut words, longer ones leave less to choose from

Part = tuple[int, int]  # first frame and number of frames


def choose_frames(
    clips: Sequence[PreparedClip],
    speeches: Sequence[SpeechFrames],
    start: float | None,
    seconds: float,
) -> list[ClipFrames]:
    """Frames to fine-tune on, of every clip, with its speech.

    Args:
        clips: of one person. Where one has too few seconds, the next gives the rest.
        start: second of each clip to begin at; None for the best seconds of all.
        seconds: in all.
    """
    if start is None:
        chosen = best_frames(clips, speeches, round(seconds * clips[0].rate))
    else:
        chosen = []
        for clip in clips:
            first = min(round(start * clip.rate), len(clip))
            frames = np.arange(first, min(first + round(seconds * clip.rate), len(clip)))
            chosen.append(frames)
            seconds -= float(len(frames) / clip.rate)
    return [ClipFrames(*one) for one in zip(clips, speeches, chosen, strict=True)]


def best_frames(
    clips: Sequence[PreparedClip], speeches: Sequence[SpeechFrames], count: int
) -> list[np.ndarray]:
    """The `count` best frames of clips, in pieces of some seconds of one shot: (F,) of each clip.

    Pieces are chosen greedily, each the one with which the chosen pieces S score highest:

        sharpness(S) * sum over k of spread_k(S) / spread_k(clips)

    k: speech features, lips, direction of view; spread: root mean square distance from the mean;
    sharpness: mean share of the clips' median gradient energy round the eyes, at most 1, 0 for
    frames without a face. The criteria are those of ISExplore (arXiv 2511.07940).
    """
    starts = np.cumsum([0, *map(len, clips)])
    if starts[-1] <= count:
        return [np.arange(len(clip)) for clip in clips]
    valid = np.concatenate([clip.detected for clip in clips])
    energy = np.where(valid, np.concatenate([eye_energy(clip) for clip in clips]), 0.0)
    sharp = np.minimum(energy / (np.median(energy[valid]) + 1e-12), 1)
    traits = []
    for of_clips in (
        [speech.windows[:, speech.windows.shape[1] // 2] for speech in speeches],
        [lip_measures(np.nan_to_num(clip.spoken().frontal_landmarks())) for clip in clips],
        [clip.c2w()[:, :, 2] for clip in clips],
    ):
        trait = np.concatenate(of_clips)
        traits.append(trait / (spread(trait[valid]) + 1e-12))

    def score(frames: np.ndarray) -> float:
        with_face = frames[valid[frames]]
        if not len(with_face):
            return 0.0
        return float(sharp[frames].mean() * sum(spread(trait[with_face]) for trait in traits))

    left = [at + piece for at, clip in zip(starts, clips, strict=False) for piece in pieces(clip)]
    taken = np.zeros(0, int)
    while len(taken) < count:
        best = max(range(len(left)), key=lambda k: score(np.concatenate([taken, left[k]])))
        taken = np.concatenate([taken, left.pop(best)[: count - len(taken)]])
    taken = np.sort(taken)
    return [taken[(taken >= a) & (taken < b)] - a for a, b in pairwise(starts)]


def pieces(clip: PreparedClip) -> list[np.ndarray]:
    """A clip's frames in pieces of about `PIECE` seconds, none across a cut."""
    cuts = np.flatnonzero(np.diff(clip.segment)) + 1
    parts: list[np.ndarray] = []
    for first, stop in pairwise([0, *cuts.tolist(), len(clip)]):
        count = max(1, round((stop - first) / (PIECE * float(clip.rate))))
        parts += np.array_split(np.arange(first, stop), count)
    return parts


def spread(values: np.ndarray) -> float:
    """Root mean square distance of rows (F, K) from their mean."""
    return float(np.sqrt(((values - values.mean(0)) ** 2).sum(1).mean()))


def eye_energy(clip: PreparedClip) -> np.ndarray:
    """Gradient energy of the luminance round the eyes of every frame, (T,): its sharpness."""
    boxes = eye_boxes(clip.landmarks, clip.size)
    left, top = boxes[:, :, :2].min(1).T
    right, bottom = boxes[:, :, 2:].max(1).T
    energy = np.zeros(len(clip))
    for k, image in enumerate(read_frames(clip.clip, rate=clip.rate)):
        if clip.detected[k] and right[k] - left[k] > 1 and bottom[k] - top[k] > 1:
            crop = cropping.crop(image, clip.crop[k], clip.size)
            eyes = crop[top[k] : bottom[k], left[k] : right[k]]
            energy[k] = gradient_energy(torch.from_numpy(eyes).float() / 255)
    return energy


def parts_of(frames: np.ndarray) -> list[Part]:
    """Runs of consecutive frames (F,): first frame and number of frames."""
    ends = [0, *(np.flatnonzero(np.diff(frames) != 1) + 1).tolist(), len(frames)]
    return [(int(frames[first]), stop - first) for first, stop in pairwise(ends) if stop > first]
