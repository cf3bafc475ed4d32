"""What lies over a face, told by the learned head: whatever it cannot explain.

The head is rendered for every frame as the film shows it, with its mouth at rest, and compared with
the picture. Where both differ by more than they do in most frames of the shot, and over more than
a fold of skin, something lies over the face: a hand, a microphone, a caption. The lips move, so
there and beside them colours decide, which `cv2.grabCut` learns from what is known to lie over the
face and what is known to be skin.

Pictures are compared in the frame of the face, W x H pixels: upright, with the outer corners of the
eyes `EYES` apart. T frames, S side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from scipy.spatial.transform import Rotation, Slerp

from dfrf.cameras import Camera
from dfrf.method_interface import Maps, Method
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dfrf.rendering.frame_renderer import render_frame
from dfrf.workers import Workers
from dubbing.compositing.face_mask import lower_share
from dubbing.engine.files import atomic_path
from dubbing.engine.stage import Progress
from dubbing.errors import PreparationError
from dubbing.face.face_contour import face_region
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.face.mouth_shape import OUTER_LIP
from dubbing.heads.pose_refinement import refined, with_refined_poses
from dubbing.identity.dataset import upper_face_expression
from dubbing.media import VideoWriter, read_frames
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.matting.matting import dilate
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking import cropping

COVERS, FRAMES = "covers.mkv", "covers.npz"
SIDE = 128  # px of the pictures that are rendered
EYES, W, H = 28.0, 88, 80  # of the frame of the face, px
EYES_AT = 8.0  # px below its upper edge
DARK = 12.0  # grey levels added before a logarithm is taken: noise of dark colours counts less
OPAQUE = 0.9  # opacity from which the head is compared
LIGHT = 9.0  # px, Gaussian: what varies more slowly is light
OUTLIER = 0.25  # of a logarithm: a place that far off says little about the light
APART = 0.22  # of a logarithm: no skin differs by more
USUAL = 2.5  # times what a place differs by in most frames
TYPICAL = 60  # frames of a shot from which that is known
THIN = 1  # px to each side: what is thinner is an edge that does not fit
LIPS = 0.12  # eye distances round the lips where words decide what is seen
LEAST = 0.03  # of the squared eye distance that must differ, beside the lips
AROUND, MOST = 2, 3  # in so many frames of those that near, or it is chance
ROUNDS = 3  # of grabCut
SOFT = 2.0  # px at 512, the edge of a mask
RIM = 3  # px round the face that are rendered
EVERY = 3  # frames between two that are looked at first
BESIDE = 6  # frames round one with something over the face
RUN = 500  # frames at most that are looked at together
AWRY = 0.09  # of a logarithm, in the median: the head does not lie on the face
AT_ONCE = 8


@dataclass(frozen=True)
class Compared:
    """A frame in the frame of the face.

    Attributes:
        picture: (H, W, 3) uint8. apart: (H, W) float32, difference from the head as a logarithm.
        known: (H, W) bool, skin of the head that words do not change. lips: (H, W) bool.
    """

    picture: np.ndarray
    apart: np.ndarray
    known: np.ndarray
    lips: np.ndarray


def to_face(landmarks: np.ndarray) -> np.ndarray:
    """The similarity (2, 3) from px of a crop to the frame of the face."""
    left, right = landmarks[LEFT_EYE_OUTER], landmarks[RIGHT_EYE_OUTER]
    across = (right - left).astype(np.float64)
    length = max(float(np.hypot(*across)), 1.0)
    cosine, sine = across / length
    turn = EYES / length * np.array([[cosine, sine], [-sine, cosine]])
    move = np.array([W / 2, EYES_AT]) - turn @ ((left + right) / 2)
    return np.concatenate([turn, move[:, None]], 1)


def compare(
    image: np.ndarray, landmarks: np.ndarray, colour: np.ndarray, opacity: np.ndarray
) -> Compared:
    """A frame beside the head.

    Args:
        image: (S, S, 3) uint8. landmarks: (478, 2) px of it.
        colour, opacity: of the head, premultiplied, (s, s, 3) and (s, s), 0..1, of any size s.
    """
    turn, size = to_face(landmarks), len(image)

    def upright(pixels: np.ndarray) -> np.ndarray:
        scale = len(pixels) / size
        own = turn.copy()
        own[:, 2] += own[:, :2] @ np.full(2, 0.5 / scale - 0.5)
        own[:, :2] /= scale
        return np.asarray(cv2.warpAffine(pixels, own, (W, H), flags=cv2.INTER_LINEAR))

    small = cv2.resize(image, (len(opacity),) * 2, interpolation=cv2.INTER_AREA)
    picture, alpha = upright(small), upright(opacity)
    head = 255 * upright(colour) / np.maximum(alpha, 0.05)[..., None]
    points = landmarks @ turn[:, :2].T + turn[:, 2]
    side = max(W, H)
    face = face_region(points, side)[:H, :W] > 0
    lower = lower_share(points, side)[:H, :W] > 0
    mouth = np.zeros((H, W), np.uint8)
    cv2.fillPoly(mouth, [points[list(OUTER_LIP)].round().astype(np.int32)], 1)
    lips = dilate(mouth > 0, LIPS * EYES)
    solid = (alpha > OPAQUE) & face
    ratio = np.log(picture + DARK) - np.log(np.clip(head, 0, 255) + DARK)
    middle = np.median(ratio[solid & ~lips], 0) if (solid & ~lips).any() else np.zeros(3)
    weight = (solid & ~lips) / (1 + (np.abs(ratio - middle).max(-1) / OUTLIER) ** 4)
    light, around = (
        cv2.GaussianBlur(x.astype(np.float32), (0, 0), LIGHT)
        for x in (weight[..., None] * (ratio - middle), weight)
    )
    apart = np.abs(ratio - middle - light / (around[..., None] + 0.02)).max(-1) * solid
    return Compared(picture, apart.astype(np.float32), solid & lower & ~lips, lips & lower)


@dataclass(frozen=True)
class Comparison:
    """Renders the head of a clip's frames at rest, and compares it with them."""

    method: Method[Any, Any]
    maps: Maps | None
    clip: PreparedClip

    def look(self, frames: np.ndarray) -> Iterator[Compared]:
        """Frames (F,), rising, one by one."""
        clip, device = self.clip, self.method.model.device
        expression = torch.from_numpy(upper_face_expression(clip)[frames]).float()
        volumes = self.method.resting_volumes(expression, self.maps)
        c2w = torch.from_numpy(clip.c2w()[frames]).float().to(device)
        scale = SIDE / clip.size
        centre = (torch.from_numpy(clip.centre[frames]).float().to(device) + 0.5) * scale - 0.5

        def one(job: tuple[int, np.ndarray]) -> Compared:
            number, image = job
            landmarks = clip.landmarks[frames[number]]
            region = dilate(face_region((landmarks + 0.5) * scale - 0.5, SIDE) > 0, RIM)
            camera = Camera(c2w[number], float(clip.focal) * scale, centre[number], SIDE)
            head = render_frame(volumes(number), camera, torch.from_numpy(region).to(device))
            return compare(image, landmarks, *(part.float().cpu().numpy() for part in head))

        with Workers(device, AT_ONCE) as workers:
            yield from workers.map(one, enumerate(images(clip, frames)))


def images(clip: PreparedClip, frames: np.ndarray) -> Iterator[np.ndarray]:
    """Crops (S, S, 3) of frames (F,), rising."""
    if not len(frames):
        return
    first, wanted = int(frames[0]), set(frames.tolist())
    films = read_frames(clip.clip, start=first, count=int(frames[-1]) - first + 1, rate=clip.rate)
    for t, whole in enumerate(films, first):
        if t in wanted:
            yield cropping.crop(whole, clip.crop[t], clip.size)


def unexplained(compared: Compared, usual: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool beside the lips that the head does not explain; none where few are.

    Args:
        usual: (H, W), by how much places differ in most frames.
    """
    beyond = (compared.apart > np.maximum(APART, USUAL * usual)) & compared.known
    kernel = np.ones((2 * THIN + 1,) * 2, np.uint8)
    solid = cv2.morphologyEx(beyond.astype(np.uint8), cv2.MORPH_OPEN, kernel)
    _, piece, stats, _ = cv2.connectedComponentsWithStats(solid)
    large = np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] >= LEAST * EYES**2) + 1
    return np.isin(piece, large)


def usual_difference(apart: np.ndarray) -> np.ndarray:
    """By how much places differ in most of the frames (F, H, W), and those beside them, (H, W)."""
    some = np.unique(np.linspace(0, len(apart) - 1, TYPICAL).round().astype(int))
    middle = np.median(apart[some].astype(np.float32), 0)
    return np.asarray(cv2.dilate(middle, np.ones((3, 3))))


def is_awry(compared: Compared, usual: np.ndarray) -> bool:
    """Whether the head does not lie on the face: much of the skin differs from it a little."""
    if not compared.known.any():
        return False
    beyond = compared.apart[compared.known] - usual[compared.known]
    return bool(np.median(beyond) > AWRY)


@dataclass
class Models:
    """Colours of what lies over a face and of what does not, as `cv2.grabCut` keeps them."""

    behind: np.ndarray
    over: np.ndarray


def cut_out(
    compared: Compared, seeds: np.ndarray, near: np.ndarray | None, models: Models | None
) -> tuple[np.ndarray, Models | None]:
    """All that lies over the face, (H, W) bool, and its colours.

    Args:
        seeds: (H, W) bool, what surely does.
        near: the same of the frame before, or after it, if that is known; with its colours.
    """
    cut = np.full((H, W), cv2.GC_PR_BGD, np.uint8)
    if near is not None:
        cut[near] = cv2.GC_PR_FGD
    cut[compared.known & (compared.apart < APART / 2)] = cv2.GC_BGD
    cut[compared.known & (compared.apart > APART)] = cv2.GC_PR_FGD
    cut[seeds] = cv2.GC_FGD
    over = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if not over.any() or over.all() or not (cut == cv2.GC_BGD).any():
        return seeds, models
    of = Models(np.zeros((1, 65)), np.zeros((1, 65)))
    mode = cv2.GC_INIT_WITH_MASK
    if models is not None and not seeds.any():
        of, mode = Models(models.behind.copy(), models.over.copy()), cv2.GC_EVAL_FREEZE_MODEL
    cv2.setRNGSeed(0)
    cv2.grabCut(compared.picture, cut, (0, 0, W, H), of.behind, of.over, ROUNDS, mode)
    found = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8)
    _, piece = cv2.connectedComponents(found)
    root = seeds if near is None else seeds | near
    return np.isin(piece, np.setdiff1d(piece[root], 0)), of


def followed(compared: list[Compared], seeds: list[np.ndarray]) -> list[np.ndarray]:
    """What lies over the face in each of some frames in a row.

    A frame without seeds takes on what its neighbours show, as far as it has the same colours.
    """
    found: list[np.ndarray] = [s.copy() for s in seeds]
    for step in (1, -1):
        near, models = None, None
        for k in range(len(seeds))[::step]:
            over, models = cut_out(compared[k], seeds[k], near, models)
            found[k] = found[k] | over
            near = over if over.any() else None
            if near is None:
                models = None
    return found


def mask_of(over: np.ndarray, image: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Mask (S, S) uint8 of what lies over the face, with the edges of the picture.

    Args:
        over: (H, W) bool. image: (S, S, 3) uint8. landmarks: (478, 2) px of it.
    """
    size = len(image)
    unit = size / 512
    back = cv2.invertAffineTransform(to_face(landmarks))
    wide = cv2.warpAffine(over.astype(np.float32), back, (size, size), flags=cv2.INTER_LINEAR)
    reach = max(2, round(float(np.hypot(*back[:, 0])) * 1.5))
    fine = cv2.ximgproc.guidedFilter(image, wide, reach, 1e-3 * 255**2)
    soft = np.clip((fine - 0.3) / 0.4, 0, 1)
    return np.asarray(
        (255 * cv2.GaussianBlur(soft, (0, 0), max(0.5, SOFT * unit))).round(), np.uint8
    )


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
    over: dict[int, np.ndarray] = {}
    if method_of(model).refines_poses:
        with torch.no_grad():
            clip, over = _covers(model, maps, clip, progress)
    shows = clip.over.copy()
    shows[list(over)] = True
    with VideoWriter(out / COVERS, clip.size, clip.size, clip.rate, "ffv1-gray") as video:
        for t, frame in enumerate(clip.film_frames() if shows.any() else ()):
            mask = np.zeros((clip.size,) * 2, np.uint8) if frame.overlay is None else frame.overlay
            if t in over:
                mask = np.maximum(mask, mask_of(over[t], frame.image, clip.landmarks[t]))
            video.write(mask)
        if not shows.any():
            video.write(np.zeros((clip.size,) * 2, np.uint8))
    covered = clip.covered & ~np.isin(np.arange(len(clip)), list(over))
    with atomic_path(out / FRAMES) as temporary:
        np.savez(temporary, over=shows, covered=covered, landmarks=clip.landmarks)
    return replace(clip, overlay=out / COVERS, over=shows, covered=covered)


def _covers(
    model: HeadModel, maps: Maps | None, clip: PreparedClip, progress: Progress
) -> tuple[PreparedClip, dict[int, np.ndarray]]:
    """The clip with better poses, and what lies over the face, (H, W) bool, by frame."""
    method = method_of(model)
    over: dict[int, np.ndarray] = {}
    shots = np.unique(clip.segment[clip.valid])
    for number, shot in enumerate(shots):
        progress(f"what lies over the face, shot {number + 1} of {len(shots)}", number / len(shots))
        frames = np.flatnonzero(clip.valid & (clip.segment == shot))
        some = np.union1d(frames[::EVERY], frames[-1:])
        first = list(Comparison(method, maps, clip).look(some))
        usual = usual_difference(np.stack([c.apart for c in first]))
        flagged = [
            t
            for t, c in zip(some, first, strict=True)
            if unexplained(c, usual).any() or is_awry(c, usual)
        ]
        near = frames[np.isin(frames, np.add.outer(flagged, np.arange(-BESIDE, BESIDE + 1)))]
        for run in runs_of(near):
            clip = _with_poses_mended(method, maps, clip, run, usual)
            compared = list(Comparison(method, maps, clip).look(run))
            seeds = steady([unexplained(c, usual) for c in compared])
            for t, found in zip(run.tolist(), followed(compared, seeds), strict=True):
                if found.any():
                    over[t] = found
    return clip, over


def _with_poses_mended(
    method: Method[Any, Any],
    maps: Maps | None,
    clip: PreparedClip,
    run: np.ndarray,
    usual: np.ndarray,
) -> PreparedClip:
    """The clip with other poses and landmarks of those frames of a run whose head lies awry.

    What hides a face moves its landmarks. The pose begins between those of the frames around, and
    is refined; the landmarks are those of the mean face in that pose.
    """
    awry = run[[is_awry(c, usual) for c in Comparison(method, maps, clip).look(run)]]
    awry = np.intersect1d(run, np.add.outer(awry, (-1, 0, 1)))
    rest = np.flatnonzero(clip.valid & (clip.segment == clip.segment[run[0]]))
    rest = np.setdiff1d(rest, awry)
    if not len(awry) or not len(rest):
        return clip
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    turns = Slerp(rest, Rotation.from_matrix(clip.rotation[rest])) if len(rest) > 1 else None
    inside = awry[(awry > rest[0]) & (awry < rest[-1])]
    if turns is not None and len(inside):
        rotation[inside] = turns(inside).as_matrix()
        for axis in range(3):
            translation[inside, axis] = np.interp(inside, rest, clip.translation[rest, axis])
    between = replace(clip, rotation=rotation, translation=translation)
    posed = refined(method.model, maps, between, awry)
    landmarks = clip.landmarks.copy()
    poses = Poses(posed.rotation[awry], posed.translation[awry])
    landmarks[awry] = project(to_camera(poses, clip.shape), clip.focal, clip.centre[awry])
    return replace(posed, landmarks=landmarks)


def seen_by_head(clip: PreparedClip, folder: Path) -> PreparedClip:
    """A clip with the poses and masks that were found with the learned head.

    Args:
        folder: that `write_poses` and `find_covers` wrote into.

    Raises:
        PreparationError: there are none, or they are of another clip.
    """
    clip = with_refined_poses(clip, folder)
    try:
        with np.load(folder / FRAMES, allow_pickle=False) as kept:
            parts = {name: kept[name] for name in ("over", "covered", "landmarks")}
    except (OSError, ValueError, KeyError) as error:
        what = f"no masks of what lies over the face: {error}"
        raise PreparationError(what, str(folder), "run with --force refine_poses") from error
    if len(parts["over"]) != len(clip):
        what = f"masks of {len(parts['over'])} frames for a clip of {len(clip)}"
        raise PreparationError(what, str(folder), "run with --force refine_poses")
    return replace(clip, overlay=folder / COVERS, **parts)


def runs_of(frames: np.ndarray) -> list[np.ndarray]:
    """Frames (F,), rising, as runs of frames in a row, of `RUN` at most."""
    if not len(frames):
        return []
    breaks = np.flatnonzero(np.diff(frames) != 1) + 1
    parts = np.split(frames, breaks)
    return [part[k : k + RUN] for part in parts for k in range(0, len(part), RUN)]


def steady(seeds: list[np.ndarray]) -> list[np.ndarray]:
    """Seeds without those of frames in whose neighbourhood few others have any."""
    some = np.array([s.any() for s in seeds], int)
    votes = np.convolve(some, np.ones(2 * AROUND + 1, int), "same")
    return [s if vote >= MOST else np.zeros_like(s) for s, vote in zip(seeds, votes, strict=True)]
