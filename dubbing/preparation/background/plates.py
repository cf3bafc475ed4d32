"""Matte and background of a whole clip, streaming, the heavy parts on a few threads.

Threads and not processes: MediaPipe, OpenCV and numpy release the interpreter's lock. T frames, S
the side of the crop in px.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.face.mesh_points import EYE_CORNERS, NOSE_BRIDGE
from dubbing.media import MediaInfo, VideoWriter, read_frames
from dubbing.preparation.alignment.silhouette import Silhouette, measure
from dubbing.preparation.alignment.threads import in_order
from dubbing.preparation.background.background import (
    PLATE_FRAMES,
    background_pixels,
    neck,
    neck_profile,
    plate,
    restore,
    rim,
    smooth_profiles,
    wall_of,
)
from dubbing.preparation.background.torso import Torso, torso
from dubbing.preparation.matting.jaw import edge_offsets, moved, smooth_offsets
from dubbing.preparation.matting.matting import (
    component_at,
    covered,
    head_matte,
    inpaint_mask,
    opacity,
    person_mask,
)
from dubbing.preparation.tracking.cropping import crop

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Footage:
    """The frames of a clip as its crops, with what tracking found in them.

    window (T, 3), landmarks (T, 478, 2) and jaw outline (T, K, 2) px of the crop, valid (T,)
    bool: the head's place is known, segment (T,) int.
    """

    info: MediaInfo
    size: int
    window: np.ndarray
    landmarks: np.ndarray
    outline: np.ndarray
    valid: np.ndarray
    segment: np.ndarray

    def crops(self) -> Iterator[np.ndarray]:
        """Crops (S, S, 3) of all frames in order."""
        return all_crops(self.info, self.window, self.size)

    def offsets(self) -> np.ndarray:
        """Place (T, 2) of the window's first pixel on the canvas of its shot, whole px (x, y)."""
        out = np.zeros((len(self.window), 2), int)
        for shot in np.unique(self.segment):
            index = self.segment == shot
            corner = self.window[index, :2]
            scale = self.size / self.window[0, 2]
            out[index] = ((corner - corner.min(0)) * scale).round()
        return out


def all_crops(info: MediaInfo, window: np.ndarray, size: int) -> Iterator[np.ndarray]:
    """Crops (S, S, 3) of all frames in order, through windows (T, 3)."""
    for t, image in enumerate(read_frames(info.path)):
        yield crop(image, window[t], size)


@dataclass(frozen=True)
class Shot:
    """What is behind the head in a shot: wall (H, W, 3) float32 on its canvas, and the torso."""

    wall: np.ndarray
    torso: Torso | None


def jaw_lines(footage: Footage, progress: Progress) -> np.ndarray:
    """The outlines moved to the edge of the jaw that is seen, (T, POINTS, 2) px."""

    def work(image: np.ndarray, t: int) -> np.ndarray:
        return edge_offsets(image, footage.outline[t])

    offsets = []
    for offset in in_order(work, ((image, t) for t, image in enumerate(footage.crops()))):
        offsets.append(offset)
        progress(len(offsets) / len(footage.window))
    smooth = smooth_offsets(np.stack(offsets), footage.segment)
    return np.stack([moved(*pair) for pair in zip(footage.outline, smooth, strict=True)])


def person_step(
    info: MediaInfo,
    window: np.ndarray,
    size: int,
    found: tuple[np.ndarray, np.ndarray],
    person: Path,
    progress: Progress,
) -> Silhouette:
    """Write the person mask of every crop, and measure the outlines of the heads.

    Args:
        window: (T, 3), see :class:`Footage`.
        found: landmarks (T, 478, 2) px of the crop, and (T,) bool where they are known.
    """
    landmarks, valid = found
    corners = landmarks[:, list(EYE_CORNERS)]

    def work(image: np.ndarray, t: int) -> tuple[np.ndarray, np.ndarray]:
        mask = person_mask(image)
        seen = np.full((2, 2), np.nan)
        if valid[t]:
            alpha = opacity(image, mask)
            # Somebody beside them is no part of the outline.
            alpha = np.where(component_at(alpha > 0.1, corners[t].mean(0)), alpha, 0)
            seen = np.stack(measure(alpha, corners[t]))
        return (mask * 255).round().astype(np.uint8), seen

    outlines = []
    jobs = ((image, t) for t, image in enumerate(all_crops(info, window, size)))
    with VideoWriter(person, size, size, info.rate, "ffv1-gray") as people:
        for mask, outline in in_order(work, jobs):
            people.write(mask)
            outlines.append(outline)
            progress(len(outlines) / len(window))
    middle, top = np.stack(outlines, axis=1)
    return Silhouette(middle, top)


def matte_step(footage: Footage, matte: Path, person: Path, progress: Progress) -> np.ndarray:
    """Write the matte; frames that do not show the head get an empty one.

    Args:
        person: masks, from :func:`person_step`.

    Returns:
        (T, PROFILE, 4) neck profiles as measured, NaN where unknown.
    """
    size, rate = footage.size, footage.info.rate
    lines = jaw_lines(footage, lambda share: progress(0.2 * share))

    def work(image: np.ndarray, seen: np.ndarray, t: int) -> tuple[np.ndarray, np.ndarray]:
        mask = seen.astype(np.float32) / 255
        if footage.valid[t]:
            bridge = footage.landmarks[t, NOSE_BRIDGE]
            alpha = head_matte(image, mask, lines[t], bridge)
        else:
            alpha = np.zeros((size, size), np.uint8)
        profile = neck_profile(image, mask, inpaint_mask(alpha), footage.landmarks[t])
        return alpha, profile

    profiles = []
    people = read_frames(person, pixels="gray")
    jobs = zip(footage.crops(), people, range(len(footage.window)), strict=True)
    with VideoWriter(matte, size, size, rate, "ffv1-gray") as mattes:
        for alpha, profile in in_order(work, jobs):
            mattes.write(alpha)
            profiles.append(profile)
            progress(0.2 + 0.8 * len(profiles) / len(footage.window))
    return np.stack(profiles)


def shots(footage: Footage, masks: tuple[Path, Path]) -> list[Shot]:
    """What is behind the head in every shot, from the mattes and person masks of some frames."""
    offsets, size = footage.offsets(), footage.size
    chosen: dict[int, list[int]] = {}
    for shot in np.unique(footage.segment):
        index = np.flatnonzero(footage.segment == shot)
        spread = np.linspace(0, len(index) - 1, PLATE_FRAMES).round().astype(int)
        chosen[int(shot)] = sorted({int(t) for t in index[spread]})
    wanted = {t: shot for shot, frames in chosen.items() for t in frames}
    out: list[Shot] = []
    seen: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    mattes, people = (read_frames(path, pixels="gray") for path in masks)
    for t, (image, alpha, mask) in enumerate(zip(footage.crops(), mattes, people, strict=True)):
        if t not in wanted:
            continue
        seen.append((image, mask.astype(np.float32) / 255, inpaint_mask(alpha)))
        frames = chosen[wanted[t]]
        if t == frames[-1]:
            images, person, inpaint_masks = (np.stack(part) for part in zip(*seen, strict=True))
            width, height = offsets[footage.segment == wanted[t]].max(0) + size
            canvas = np.zeros((len(frames), height, width, 3), np.uint8)
            known = np.zeros((len(frames), height, width), bool)
            for k, (x, y) in enumerate(offsets[frames]):
                canvas[k, y : y + size, x : x + size] = images[k]
                known[k, y : y + size, x : x + size] = background_pixels(person[k])
            out.append(Shot(plate(canvas, known), torso(images, person, inpaint_masks)))
            seen = []
    return out


def torso_motions(footage: Footage, behind: list[Shot], progress: Progress) -> np.ndarray:
    """What lays the torso of its shot over each frame, (T, 2, 3), NaN where there is none.

    Frames in which it is not found take what lies between their neighbours.
    """

    def work(image: np.ndarray, t: int) -> np.ndarray | None:
        found = behind[footage.segment[t]].torso
        return None if found is None else found.motion(image)

    out = np.full((len(footage.window), 2, 3), np.nan)
    for t, motion in enumerate(in_order(work, ((i, t) for t, i in enumerate(footage.crops())))):
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


def background_step(
    footage: Footage,
    profiles: np.ndarray,
    masks: tuple[Path, Path],
    background: Path,
    progress: Progress,
) -> None:
    """Write the restored background: the pixels of the inpaint mask, black elsewhere.

    Args:
        profiles: (T, PROFILE, 4), from :func:`matte_step`. masks: matte and person.
    """
    size, rate = footage.size, footage.info.rate
    behind, offsets = shots(footage, masks), footage.offsets()
    motions = torso_motions(footage, behind, lambda share: progress(0.3 * share))
    smooth = smooth_profiles(profiles, footage.segment)

    def work(image: np.ndarray, alpha: np.ndarray, mask: np.ndarray, t: int) -> np.ndarray:
        x, y = offsets[t]
        shot = behind[footage.segment[t]]
        region = covered(alpha, footage.outline[t])
        person = mask.astype(np.float32) / 255
        wall = wall_of(image, shot.wall[y : y + size, x : x + size], person)
        left, under = region, image
        if shot.torso is not None:
            under, left = shot.torso.fill(image, region, wall, motions[t])
        growing = neck(under, left, footage.landmarks[t], smooth[t])
        growing = rim(under, left, person, growing)
        restored = restore(under, left, wall, growing)
        return np.where(inpaint_mask(alpha)[..., None], restored, 0).astype(np.uint8)

    mattes, people = (read_frames(path, pixels="gray") for path in masks)
    frames = zip(footage.crops(), mattes, people, range(len(footage.window)), strict=True)
    with VideoWriter(background, size, size, rate, "ffv1") as writer:
        for filled in in_order(work, frames):
            writer.write(filled)
            progress(0.3 + 0.7 * writer.frames / len(footage.window))
