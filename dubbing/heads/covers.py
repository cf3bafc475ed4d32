"""Finds things that lie over a face: whatever the learned head cannot explain.

A hand, a microphone, a caption stay in front of the new mouth. Where something else has the colours
of skin, or the head does not lie on the face, the frame is covered: the film keeps its own mouth. T
frames, S side of the crop in px, H and W as in `comparison`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch

from dfrf.method_interface import Maps
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dubbing.compositing.grade import NEUTRAL, grades
from dubbing.compositing.jaw_line import ANGLES, jaw_lines
from dubbing.compositing.lip_colour import SAME, lip_colour
from dubbing.engine.disk.files import atomic_path
from dubbing.engine.graph.stage import Progress
from dubbing.face.finding.hand_finder import HandFinder
from dubbing.heads.comparison import (
    Compared,
    Comparison,
    images,
    is_awry,
    usual_difference,
)
from dubbing.heads.cover_cut import (
    bare_face,
    beside_told,
    followed,
    is_large,
    is_like_skin,
    is_shade,
    mask_of,
    steady,
    unexplained,
    without_dents,
)
from dubbing.heads.hand_cut import hand_mask, in_face, lies_over
from dubbing.heads.mended_poses import with_poses_mended
from dubbing.heads.pose_refinement import trust
from dubbing.media import VideoWriter
from dubbing.preparation.head_findings import COVERED_FILE, COVERS_FILE
from dubbing.preparation.prepared import PreparedClip

TYPICAL = 60  # frames of a shot from which is known what differs usually
EVERY = 3  # frames between two that are looked at first
# Of a logarithm: what differs more lies over the face, even if it is there all through a shot,
# unless it has the face's colours, as a shadow has.
MOST_USUAL = 0.18
BESIDE = 6  # frames round one with something over the face
RUN = 500  # frames at most that are looked at together
BRIEF = 0.3  # s: nothing that hides a face, and has its colours, is there for less


@dataclass(frozen=True)
class Cover:
    """Lies over a face in a frame: pixels (H, W) bool; hands, points (21, 3) px of the crop; bare
    (H, W) bool, see `bare_face`."""

    pixels: np.ndarray
    hands: list[np.ndarray]
    bare: np.ndarray

    def mask(self, image: np.ndarray, told: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
        """Mask (S, S) uint8 for a crop (S, S, 3) in which the face has landmarks (478, 2).

        Args:
            told: (S, S) uint8, the preparation's mask, which is in it.
        """
        own = beside_told(self.pixels, told, landmarks, self.bare)
        rest = mask_of(own, image, landmarks)
        rest = np.maximum(rest, told)
        return np.maximum(rest, hand_mask(image, self.hands)) if self.hands else rest


def find_covers(
    model: HeadModel, maps: Maps | None, clip: PreparedClip, out: Path, progress: Progress
) -> PreparedClip:
    """Writes OUT/covers.mkv, masks of all frames, and OUT/covers.npz: which of them show any.

    Masks of the preparation are in them. A method that refines no poses finds nothing more.

    Args:
        clip: with poses that the model refined.

    Returns:
        The clip with these masks, and better poses of frames in which something hides the face.
    """
    over: dict[int, Cover] = {}
    jaw, grade = np.zeros((len(clip), len(ANGLES)), np.float32), np.tile(NEUTRAL, (len(clip), 1))
    clip = replace(clip, jaw=jaw, grade=grade, lip_colour=np.tile(SAME, (len(clip), 1)))
    if method_of(model).refines_poses:
        with torch.no_grad():
            clip, over = _covers(model, maps, clip, progress)
    shows = clip.over.copy()
    shows[list(over)] = True
    with VideoWriter(out / COVERS_FILE, clip.size, clip.size, clip.rate, "ffv1-gray") as video:
        first, stop = clip.part
        frames = clip.film_frames(first, stop - first) if shows.any() else ()
        for t, frame in enumerate(frames, first):
            mask = np.zeros((clip.size,) * 2, np.uint8) if frame.overlay is None else frame.overlay
            if t in over:
                mask = over[t].mask(frame.image, mask, clip.landmarks[t])
            video.write(mask)
        if not shows.any():
            video.write(np.zeros((clip.size,) * 2, np.uint8))
    with atomic_path(out / COVERED_FILE) as temporary:
        np.savez(
            temporary,
            over=shows,
            covered=clip.covered,
            landmarks=clip.landmarks,
            jaw=np.asarray(clip.jaw),
            grade=np.asarray(clip.grade),
            lip_colour=np.asarray(clip.lip_colour),
        )
    return replace(clip, overlay=out / COVERS_FILE, over=shows)


def _covers(
    model: HeadModel, maps: Maps | None, clip: PreparedClip, progress: Progress
) -> tuple[PreparedClip, dict[int, Cover]]:
    """The clip with better poses; what lies over the face, by frame.

    Of the frames in which the head is known those are covered in which something lies over the
    face that cannot be told from it.
    """
    method = method_of(model)
    over: dict[int, Cover] = {}
    hidden: set[int] = set()
    jaw, grade = np.zeros((len(clip), len(ANGLES)), np.float32), np.tile(NEUTRAL, (len(clip), 1))
    lips = np.tile(SAME, (len(clip), 1))
    # From where it was never seen, a head explains nothing.
    known = (trust(torch.from_numpy(clip.c2w()).float(), maps) > 0).numpy()
    covered = clip.covered & ~(clip.valid & known)
    shots = np.unique(clip.segment[clip.valid])
    for number, shot in enumerate(shots):
        progress(f"what lies over the face, shot {number + 1} of {len(shots)}", number / len(shots))
        frames = np.flatnonzero(clip.valid & (clip.segment == shot) & known)
        if not len(frames):
            continue
        some = np.union1d(frames[::EVERY], frames[-1:])
        comparison = Comparison(method, maps, clip)
        looked = list(comparison.look(some))
        spread = np.unique(np.linspace(0, len(some) - 1, TYPICAL).round().astype(int))
        usual = usual_difference(np.stack([looked[k].apart for k in spread]))
        always = np.minimum(usual, MOST_USUAL)
        flagged = [
            t
            for t, c in zip(some, looked, strict=True)
            if unexplained(c, always).any() or is_awry(c, usual)
        ]
        near = frames[np.isin(frames, np.add.outer(flagged, np.arange(-BESIDE, BESIDE + 1)))]
        free = ~np.isin(some, near)
        jaw[frames] = jaw_lines(some[free], [looked[k].jaw for k in np.flatnonzero(free)], frames)
        grade[frames] = grades(some, [seen.grade for seen in looked], frames)
        for run in runs_of(near):
            clip, awry = with_poses_mended(method, maps, clip, run, usual)
            compared = list(Comparison(method, maps, clip).look(run))
            seeds = steady([unexplained(c, always) for c in compared])
            found = followed(compared, seeds)
            hands = HandFinder().follow(images(clip, run))
            parts = zip(run.tolist(), compared, found, seeds, hands, strict=True)
            for t, seen, mask, sure, nearby in parts:
                held = [hand for hand in nearby if lies_over(hand, seen, clip.landmarks[t])]
                placed = [in_face(hand, clip.landmarks[t]) for hand in held]
                cover = told_apart(seen, mask, sure, held, placed, usual)
                if cover is not None:
                    over[t] = cover
                elif is_large(seen, sure & unexplained(seen, usual)) or t in awry:
                    hidden.add(t)
        shown = [k for k, t in enumerate(some) if t not in over and t not in hidden]
        lips[frames] = lip_colour([looked[k].lip_colour for k in shown])
    covered[list(lasting(hidden, BRIEF * float(clip.rate)))] = True
    return replace(clip, jaw=jaw, grade=grade, lip_colour=lips, covered=covered), over


def told_apart(
    seen: Compared,
    mask: np.ndarray,
    sure: np.ndarray,
    hands: list[np.ndarray],
    placed: list[np.ndarray],
    usual: np.ndarray,
) -> Cover | None:
    """The cover of a face, where it can be told from it: by its colours, or as a hand.

    A piece that has the face's colours and touches no hand is skin: a fold, deep shade, or lips in
    motion. One on the lips alone is of another word.

    Args:
        mask: (H, W) bool, cut out by colours. sure: what of it differs from the head.
        hands: that lie over the face. placed: pixels (H, W) of each, see `hand_cut.in_face`.
        usual: (H, W), by how much places differ in most frames of the shot.
    """

    def is_skin(part: np.ndarray) -> bool:
        return is_like_skin(seen, part) or is_shade(seen, part, usual)

    by_colours = mask.any() and not is_skin(mask)
    near, pixels = np.any([np.zeros_like(mask), *placed], axis=0), np.zeros_like(mask)
    whole = mask if by_colours else sure
    count, pieces = cv2.connectedComponents(whole.astype(np.uint8))
    for piece in (pieces == k for k in range(1, count)):
        coloured = by_colours and (piece & ~seen.lips).any() and not is_skin(piece)
        if coloured:
            pixels |= without_dents(piece, seen)
        elif (piece & near).any():
            pixels |= piece
    return Cover(pixels, hands, bare_face(seen)) if hands or pixels.any() else None


def lasting(hidden: set[int], least: float) -> set[int]:
    """Frames that are in a run of at least so many: a turned head differs in a few by chance."""
    runs = runs_of(np.array(sorted(hidden), int))
    return {t for run in runs if len(run) >= least for t in run.tolist()}


def runs_of(frames: np.ndarray) -> list[np.ndarray]:
    """Frames (F,), rising, as runs of frames in a row, of `RUN` at most."""
    if not len(frames):
        return []
    breaks = np.flatnonzero(np.diff(frames) != 1) + 1
    parts = np.split(frames, breaks)
    return [part[k : k + RUN] for part in parts for k in range(0, len(part), RUN)]
