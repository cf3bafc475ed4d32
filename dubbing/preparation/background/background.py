"""The restored background of a whole clip, streaming, the heavy parts on a few threads.

T frames, S the side of the crop in px.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dubbing.media import VideoWriter, read_frames
from dubbing.preparation.background.neck import neck, neck_profile, smooth_profiles
from dubbing.preparation.background.pixels import box_of, chosen
from dubbing.preparation.background.rim import REACH, restore, rim
from dubbing.preparation.background.torso import Torso, torso
from dubbing.preparation.background.wall import background_pixels, plate, slow_difference
from dubbing.preparation.footage.footage import Footage
from dubbing.preparation.footage.threads import in_order
from dubbing.preparation.matting.matting import REFERENCE_SIZE, covered, inpaint_mask

PLATE_FRAMES = 40
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Shot:
    """What is behind the head in a shot: wall (H, W, 3) float32 on its canvas, and the torso."""

    wall: np.ndarray
    torso: Torso | None


def plate_frames(segment: np.ndarray, lit: np.ndarray) -> list[np.ndarray]:
    """Frames of every shot that its plates are made of; segment (T,) int.

    Args:
        lit: (T,) bool, frames in a light that is usual enough; others only where there are none.
    """
    out = []
    for shot in range(segment[-1] + 1):
        index = np.flatnonzero(segment == shot)
        index = index[lit[index]] if lit[index].any() else index
        spread = np.linspace(0, len(index) - 1, PLATE_FRAMES).round().astype(int)
        out.append(index[np.unique(spread)])
    return out


def neck_profiles(
    footage: Footage, matte: Path, wanted: set[int], progress: Progress
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Neck profiles (T, PROFILE, 4) of all frames, and the inpaint masks of those wanted."""

    def work(alpha: np.ndarray, t: int) -> tuple[np.ndarray, np.ndarray]:
        hole = inpaint_mask(alpha)
        seen = footage.crops[t], footage.person[t], hole, footage.landmarks[t]
        return neck_profile(*seen), hole

    profiles, holes = [], {}
    frames = zip(read_frames(matte, pixels="gray"), range(len(footage)), strict=True)
    for t, (profile, hole) in enumerate(in_order(work, frames)):
        profiles.append(profile)
        if t in wanted:
            holes[t] = hole
        progress((t + 1) / len(footage))
    return smooth_profiles(np.stack(profiles), footage.segment), holes


def shots(footage: Footage, plates: list[np.ndarray], holes: dict[int, np.ndarray]) -> list[Shot]:
    """What is behind the head in every shot, from some of its frames with their inpaint masks."""
    offsets, size = footage.offsets(), footage.size

    def work(frames: np.ndarray) -> Shot:
        images, people = footage.unlit(frames), footage.person[frames]
        width, height = offsets[footage.segment == footage.segment[frames[0]]].max(0) + size
        canvas = np.zeros((len(frames), height, width, 3), np.uint8)
        known = np.zeros((len(frames), height, width), bool)
        for k, (x, y) in enumerate(offsets[frames]):
            canvas[k, y : y + size, x : x + size] = images[k]
            known[k, y : y + size, x : x + size] = background_pixels(people[k])
        found = partial(torso, images, people, np.stack([holes[t] for t in frames]))
        return Shot(*in_order(lambda half: half(), [(partial(plate, canvas, known),), (found,)]))

    return [work(frames) for frames in plates]


def torso_motions(footage: Footage, behind: list[Shot], progress: Progress) -> np.ndarray:
    """What lays the torso of its shot over each frame, (T, 2, 3), NaN where there is none.

    Frames in which it is not found take what lies between their neighbours.
    """

    def work(t: int) -> np.ndarray | None:
        found = behind[footage.segment[t]].torso
        return None if found is None else found.motion(footage.crops[t])

    out = np.full((len(footage), 2, 3), np.nan)
    for t, motion in enumerate(in_order(work, ((t,) for t in range(len(footage))))):
        if motion is not None:
            out[t] = motion
        progress((t + 1) / len(out))
    for shot in np.unique(footage.segment):
        index = np.flatnonzero(footage.segment == shot)
        part = out[index].reshape(-1, 6)
        known = np.flatnonzero(np.isfinite(part[:, 0]))
        if len(known):
            every = np.arange(len(index))
            filled = [np.interp(every, known, part[known, k]) for k in range(6)]
            out[index] = np.stack(filled, -1).reshape(-1, 2, 3)
    return out


def background_step(footage: Footage, matte: Path, background: Path, progress: Progress) -> None:
    """Write the restored background: the pixels of the inpaint mask, black elsewhere."""
    size, rate = footage.size, footage.info.rate
    unit = size / REFERENCE_SIZE
    plates = plate_frames(footage.segment, footage.well_lit())
    wanted = set(np.concatenate(plates).tolist())
    smooth, holes = neck_profiles(footage, matte, wanted, lambda share: progress(0.1 * share))
    behind, offsets = shots(footage, plates, holes), footage.offsets()
    motions = torso_motions(footage, behind, lambda share: progress(0.1 + 0.2 * share))

    def work(alpha: np.ndarray, t: int) -> np.ndarray:
        image, mask = footage.crops[t], footage.person[t]
        out, hole = np.zeros_like(image), inpaint_mask(alpha)
        if not hole.any():
            return out
        region = covered(hole, alpha, footage.outline[t])
        box = box_of(hole, round(REACH * unit))
        x, y = offsets[t]
        shot = behind[footage.segment[t]]
        plate_here = footage.lit(shot.wall[y : y + size, x : x + size], t)
        light = slow_difference(image, plate_here, background_pixels(mask))
        wall = plate_here[box] + light[box]
        under, left = image[box], region[box]
        if shot.torso is not None:
            torso_here = replace(shot.torso, colour=footage.lit(shot.torso.colour, t))
            under, left = torso_here.fill(image, region, wall, motions[t], box)
        landmarks = footage.landmarks[t] - (box[1].start, box[0].start)
        growing = neck(under, left, landmarks, smooth[t], unit)
        growing = rim(under, left, mask[box].astype(np.float32) / 255, growing, unit)
        out[box] = chosen(hole[box], restore(under, left, wall, growing), out[box])
        return out

    frames = zip(read_frames(matte, pixels="gray"), range(len(footage)), strict=True)
    with VideoWriter(background, size, size, rate, "ffv1") as writer:
        for filled in in_order(work, frames):
            writer.write(filled)
            progress(0.3 + 0.7 * writer.frames / len(footage))
