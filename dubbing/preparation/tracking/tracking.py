"""From landmarks to head poses: mean shape, bundle adjustment, photometric refinement.

T frames. Every step returns a dictionary of arrays, which is also written to disk.
"""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import RIGID
from dubbing.media import MediaInfo
from dubbing.preparation.alignment.banded import second_difference_links
from dubbing.preparation.alignment.bundle import Observations, fit_poses, start_poses, triangulate
from dubbing.preparation.alignment.camera import Poses, focal_length, project, to_camera
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.photometric import Alignment
from dubbing.preparation.alignment.refinement import refine
from dubbing.preparation.alignment.relief import solve_relief
from dubbing.preparation.alignment.score import residual_shift
from dubbing.preparation.alignment.silhouette import Silhouette
from dubbing.preparation.alignment.skin import reference_frame, skin_points
from dubbing.preparation.tracking.cropping import to_crop
from dubbing.preparation.tracking.detection import Arrays
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape
from dubbing.preparation.turning.turned import frontal

APART = 3.0  # px at a crop of 512: tracking and static mode disagree, something may cover the face
HIDDEN = 2.0  # times as much: the frame is not used at all
BRIDGE_SECONDS = 0.5  # longest gap over which smoothness bridges poses
SHAPE_FRAMES = 250
RELIEF_FRAMES = 150


def principal_points(window: np.ndarray, source_size: tuple[int, int], size: int) -> np.ndarray:
    """Middle of the full frame in px of every crop: (T, 2) for windows (T, 4)."""
    middle = (np.array(source_size) - 1) / 2
    return np.stack([to_crop(middle, w, size, source_size) for w in window])


def observations(info: MediaInfo, size: int, surveyed: Arrays, detected: Arrays) -> Observations:
    """Observations for bundle adjustment: rigid points, weighted by how well the modes agree."""
    apart = np.maximum(detected["apart"] / (APART * size / 512), 1)
    confidence = np.where(detected["valid"] & (apart < HIDDEN), 1 / apart**2, 0)
    if not confidence.any():  # a clip so blurred that the modes never agree
        confidence = detected["valid"].astype(np.float64)
    return Observations(
        pixels=detected["points"][:, list(RIGID), :2].astype(np.float64),
        confidence=confidence,
        linked=second_difference_links(
            surveyed["segment"], bridged(confidence > 0, float(info.rate)), surveyed["repeated"]
        ),
        focal=focal_length(surveyed["window"], (info.width, info.height), size),
        centre=principal_points(surveyed["window"], (info.width, info.height), size),
        rate=float(info.rate),
    )


def bridged(usable: np.ndarray, rate: float) -> np.ndarray:
    """Frames (T,) bool that are usable, or lie in a gap of at most `BRIDGE_SECONDS`."""
    out = usable.copy()
    index = np.flatnonzero(usable)
    for before, after in itertools.pairwise(index):
        if after - before - 1 <= BRIDGE_SECONDS * rate:
            out[before:after] = True
    return out


def bundle_step(observed: Observations, detected: Arrays, progress: ReportShare) -> Arrays:
    """Mean shape, and poses that fit it to the landmarks.

    The shape is the mean of FaceMesh's shapes. Solved from landmarks together with the poses it
    would become flat, as landmarks exaggerate turns.

    Returns:
        shape (478, 3) in the head frame, rotation (T, 3, 3), translation (T, 3).
    """
    some = observed.spread(SHAPE_FRAMES)
    shape = head_frame(mean_shape(detected["points"][some].astype(np.float64), RIGID))
    progress(0.3)
    rigid = shape[list(RIGID)]
    poses = fit_poses(rigid, start_poses(rigid, observed), observed)
    progress(1.0)
    return {"shape": shape, "rotation": poses.rotation, "translation": poses.translation}


def trusted_step(
    observed: Observations, detected: Arrays, segment: np.ndarray, progress: ReportShare
) -> Arrays:
    """Mean shape and poses as of `bundle_step`, from frames whose landmarks can be trusted.

    Returns:
        shape, rotation, translation; trusted (T,) bool. Other frames have the poses that their
        landmarks give.
    """
    found = bundle_step(observed, detected, lambda share: progress(share / 2))
    rough = Poses(found["rotation"], found["translation"])
    trusted = frontal(rough, detected["valid"], segment)
    if trusted[detected["valid"]].all():
        return found | {"trusted": trusted}
    some = only(observed, trusted)
    better = bundle_step(some, detected, lambda share: progress(0.5 + share / 2))
    return better | {
        "rotation": np.where(trusted[:, None, None], better["rotation"], rough.rotation),
        "translation": np.where(trusted[:, None], better["translation"], rough.translation),
        "trusted": trusted,
    }


def only(observed: Observations, trusted: np.ndarray) -> Observations:
    """Observations of trusted frames (T,) alone; the others give none."""
    outline = observed.silhouette
    if outline is not None:
        outline = Silhouette(
            *(np.where(trusted[:, None], at, np.nan) for at in (outline.middle, outline.top))
        )
    confidence = np.where(trusted, observed.confidence, 0)
    return replace(observed, confidence=confidence, silhouette=outline)


def refine_step(
    observed: Observations,
    detected: Arrays,
    bundle: Arrays,
    crops: np.ndarray,
    scratch: Path,
    progress: ReportShare,
) -> Arrays:
    """Poses refined by the pixels, the shape from them, and the score of the track.

    Args:
        crops: (T, S, S, 3). scratch: a file for the faces cut out of them, deleted at the end.

    Returns:
        shape, rotation, translation as before; residual_shift (T, 2) px, NaN where not usable.
    """
    size = crops.shape[1]
    shape, poses = bundle["shape"], Poses(bundle["rotation"], bundle["translation"])
    rigid = shape[list(RIGID)]
    middle = reference_frame(poses, observed.usable)
    view = poses[middle : middle + 1]
    skin = skin_points(shape, view, observed.focal, observed.centre[middle : middle + 1], size)
    pixels = project(to_camera(poses, skin.points), observed.focal, observed.centre)
    strip = FaceStrip.record(scratch, crops, pixels)
    progress(0.1)
    aligned = Alignment(skin.half(0), strip, observed.focal, observed.centre)
    some = observed.spread(RELIEF_FRAMES)
    relief, texture = solve_relief(
        poses[some],
        aligned.take(some),
        rigid,
        observed.take(some),
        view,
        lambda share: progress(0.1 + 0.3 * share),
    )
    aligned = aligned.with_skin(relief.bend(aligned.skin))
    poses = refine(
        poses, aligned, texture, rigid, observed, lambda share: progress(0.4 + 0.5 * share)
    )
    shape = triangulate(shape, detected["points"][:, :, :2].astype(np.float64), poses, observed)
    # Scored on points that were not used in the alignment.
    judged = Alignment(relief.bend(skin.half(1)), strip, observed.focal, observed.centre)
    shift = np.full((len(poses), 2), np.nan)
    usable = np.flatnonzero(observed.usable)
    shift[usable] = residual_shift(poses, usable, judged)
    scratch.unlink()
    progress(1.0)
    return {
        "shape": shape,
        "rotation": poses.rotation,
        "translation": poses.translation,
        "residual_shift": shift,
    }
