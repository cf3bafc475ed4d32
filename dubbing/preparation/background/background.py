"""Restores the background of a whole clip frame by frame, on a few threads.

T frames, S the side of the crop in px.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.media import VideoWriter
from dubbing.preparation.background.filling import CONTEXT_PX, restore
from dubbing.preparation.background.pixels import chosen, extent
from dubbing.preparation.background.torso import Torso, torso
from dubbing.preparation.background.wall import (
    all_of,
    background_pixels,
    halved,
    plate,
    slow_difference,
)
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.crops.tracked_crops import TrackedCrops
from dubbing.preparation.matting.matting import REFERENCE_SIZE, covered, inpaint_mask

PLATE_FRAMES = 40


@dataclass(frozen=True)
class Shot:
    """The background of a shot: wall (H, W, 3) float32 on its canvas, and the torso."""

    wall: np.ndarray
    torso: Torso | None


def plate_frames(segment: np.ndarray, lit: np.ndarray) -> list[np.ndarray]:
    """Frames of every shot that its plates are made of; segment (T,) int.

    Args:
        lit: (T,) bool, frames in about the usual light; others are used only without such.
    """
    out = []
    for shot in range(segment[-1] + 1):
        index = np.flatnonzero(segment == shot)
        index = index[lit[index]] if lit[index].any() else index
        spread = np.linspace(0, len(index) - 1, PLATE_FRAMES).round().astype(int)
        out.append(index[np.unique(spread)])
    return out


def shots(clip: TrackedCrops, plates: list[np.ndarray], alphas: np.ndarray) -> list[Shot]:
    """The background of every shot, from some of its frames with their mattes."""
    offsets, size = clip.offsets(), clip.size

    def work(frames: np.ndarray) -> Shot:
        images, people = clip.unlit(frames), clip.person[frames]
        width, height = offsets[clip.segment == clip.segment[frames[0]]].max(0) + size
        canvas = np.zeros((len(frames), height, width, 3), np.uint8)
        known = np.zeros((len(frames), height, width), bool)
        for k, (x, y) in enumerate(offsets[frames]):
            canvas[k, y : y + size, x : x + size] = images[k]
            known[k, y : y + size, x : x + size] = background_pixels(people[k])
        wall = partial(plate, canvas, known)
        front = partial(torso, images, people, np.stack([inpaint_mask(alphas[t]) for t in frames]))
        return Shot(*in_order(lambda part: part(), [(wall,), (front,)]))

    return [work(frames) for frames in plates]


def torso_motions(clip: TrackedCrops, behind: list[Shot], progress: ReportShare) -> np.ndarray:
    """Similarities (T, 2, 3) that align the torso of its shot to each frame, NaN without a torso.

    Frames in which it cannot be tracked are interpolated.
    """

    def work(t: int) -> np.ndarray | None:
        front = behind[clip.segment[t]].torso
        return None if front is None else front.motion(clip.crops[t])

    out = np.full((len(clip), 2, 3), np.nan)
    for t, motion in enumerate(in_order(work, ((t,) for t in range(len(clip))))):
        if motion is not None:
            out[t] = motion
        progress((t + 1) / len(out))
    for shot in np.unique(clip.segment):
        index = np.flatnonzero(clip.segment == shot)
        part = out[index].reshape(-1, 6)
        known = np.flatnonzero(np.isfinite(part[:, 0]))
        if len(known):
            every = np.arange(len(index))
            filled = [np.interp(every, known, part[known, k]) for k in range(6)]
            out[index] = np.stack(filled, -1).reshape(-1, 2, 3)
    return out


def background_step(
    clip: TrackedCrops,
    alphas: np.ndarray,
    shown: Sequence[int],
    background: Path,
    progress: ReportShare,
) -> np.ndarray:
    """Write the restored background: the pixels of the inpaint mask, black elsewhere.

    Args:
        alphas: (T, S, S) uint8, the matte. shown: numbers of K frames, rising.

    Returns:
        The frames shown, (K, S, S, 3) uint8.
    """
    size, rate = clip.size, clip.info.rate
    behind = shots(clip, plate_frames(clip.segment, clip.well_lit()), alphas)
    offsets = clip.offsets()
    motions = torso_motions(clip, behind, lambda share: progress(0.1 + 0.2 * share))

    def work(t: int) -> np.ndarray:
        image, mask, alpha = clip.crops[t], clip.person[t], alphas[t]
        out, hole = np.zeros_like(image), inpaint_mask(alpha)
        if not hole.any():
            return out
        region = covered(hole, alpha, clip.outline[t])
        box = extent(hole, round(CONTEXT_PX * size / REFERENCE_SIZE))
        x, y = offsets[t]
        shot = behind[clip.segment[t]]
        plate_here = clip.lit(shot.wall[y : y + size, x : x + size], t)
        known = all_of(background_pixels(mask))
        light = slow_difference(halved(image), halved(plate_here), known, size)
        wall = plate_here[box] + light[box]
        under, left = image[box], region[box]
        if shot.torso is not None:
            torso_here = replace(shot.torso, colour=clip.lit(shot.torso.colour, t))
            under, left = torso_here.fill(image, region, wall, motions[t], box)
        filled = restore(under, left, mask[box].astype(np.float32) / 255, wall)
        out[box] = chosen(hole[box], filled, out[box])
        return out

    kept: list[np.ndarray] = []
    with VideoWriter(background, size, size, rate, "ffv1") as writer:
        for t, filled in enumerate(in_order(work, ((t,) for t in range(len(clip))))):
            writer.write(filled)
            if t in shown:
                kept.append(filled)
            progress(0.3 + 0.7 * writer.frames / len(clip))
    return np.stack(kept)
