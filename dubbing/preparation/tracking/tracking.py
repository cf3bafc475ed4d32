"""From frames to head poses: landmarks, mean shape, bundle adjustment, photometric refinement.

T frames. Every step returns a dictionary of arrays, which is also written to disk.
"""

import itertools
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from dubbing.engine.stage import ReportShare
from dubbing.errors import PreparationError
from dubbing.face.landmarks import TwoModes
from dubbing.face.mesh_points import JAW, RIGID
from dubbing.media import MediaInfo, read_frames
from dubbing.preparation.alignment.banded import second_difference_links
from dubbing.preparation.alignment.bundle import Observations, fit_poses, start_poses, triangulate
from dubbing.preparation.alignment.camera import Poses, focal_length, project, to_camera
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.photometric import Alignment
from dubbing.preparation.alignment.refinement import refine
from dubbing.preparation.alignment.relief import solve_relief
from dubbing.preparation.alignment.score import residual_shift
from dubbing.preparation.alignment.skin import reference_frame, skin_points
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.crops.tracked_crops import CROPS, create_images
from dubbing.preparation.matting.masks import People
from dubbing.preparation.tracking.cropping import choose_windows, crop, to_crop
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape
from dubbing.preparation.tracking.survey import Survey, survey

APART = 3.0  # px at a crop of 512: tracking and static mode disagree, something may cover the face
HIDDEN = 2.0  # times as much: the frame is not used at all
BRIDGE_SECONDS = 0.5  # longest gap over which smoothness bridges poses
SHAPE_FRAMES = 250
RELIEF_FRAMES = 150
BATCH = 8  # frames that the networks look at together
LEAST_FRAMES = 5
# From the ends of the jaw line to below the ear lobes, in units of 10 cm: out, down and back.
LOBES = np.array([[-0.12, 0.1, 0.45], [0.12, 0.1, 0.45]])

Arrays = dict[str, np.ndarray]


def survey_step(info: MediaInfo, people: Sequence[Portrait], progress: ReportShare) -> Arrays:
    """Cuts, the followed face's boxes and the crop windows; see :mod:`survey`."""
    result: Survey = survey(info, progress, people)
    window = choose_windows(result.box, result.segment, (info.width, info.height), float(info.rate))
    return {
        "segment": result.segment,
        "repeated": result.repeated,
        "shown": result.shown,
        "box": result.box,
        "distance": result.distance,
        "followed": np.isfinite(result.distance)[result.segment],
        "window": window,
        "most_faces": np.array(result.most_faces),
        "other": result.other,
    }


def landmark_step(
    info: MediaInfo, size: int, surveyed: Arrays, folder: Path, progress: ReportShare
) -> Arrays:
    """Landmarks of every frame in px of its crop; also writes the crops, and the masks of `People`.

    Faces are tracked from frame to frame in order; threads compute the masks of earlier frames.

    Returns:
        points (T, 478, 3), apart (T,) px between the two modes, valid (T,) bool; middle and top
        (T, 2) of a :class:`Silhouette`.

    Raises:
        PreparationError: hardly any frame has a face.
    """
    segment, window, box = surveyed["segment"], surveyed["window"], surveyed["box"]
    points = np.zeros((info.frames, 478, 3), np.float32)
    apart, valid = np.zeros(info.frames, np.float32), np.zeros(info.frames, bool)
    crops = create_images(folder / CROPS, info.frames, size, size, 3)

    starts = np.diff(segment, prepend=segment[0]) != 0
    detect = TwoModes(int(surveyed["most_faces"]))

    def followed() -> Iterator[tuple[int, list[np.ndarray | None]]]:
        images = enumerate(read_frames(info.path))
        while batch := list(islice(images, BATCH)):
            rows = [t for t, _ in batch]
            for t, image in batch:
                crops[t] = crop(image, window[t], size)
            middles = [to_crop((box[t, :2] + box[t, 2:]) / 2, window[t], size) for t in rows]
            found = detect(crops[rows[0] : rows[-1] + 1], np.stack(middles), starts[rows])
            points[rows], apart[rows], valid[rows] = map(np.stack, zip(*found, strict=True))
            valid[rows] &= surveyed["followed"][rows]
            yield rows[0], [points[t] if valid[t] else None for t in rows]
            progress((rows[-1] + 1) / info.frames)

    people = People(folder, crops)
    outlines = np.concatenate(list(in_order(people.look, followed())), axis=1)
    if valid.sum() < LEAST_FRAMES:
        raise PreparationError(
            f"a face in only {int(valid.sum())} of {info.frames} frames",
            str(info.path),
            "use a clip in which the speaker faces the camera",
        )
    detected = {"points": points, "apart": apart, "valid": valid}
    return detected | dict(zip(("middle", "top"), outlines, strict=True))


def principal_points(window: np.ndarray, source_size: tuple[int, int], size: int) -> np.ndarray:
    """Middle of the full frame in px of every crop: (T, 2) for windows (T, 3)."""
    middle = (np.array(source_size) - 1) / 2
    return np.stack([to_crop(middle, w, size) for w in window])


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


def filled_landmarks(
    detected: Arrays, shape: np.ndarray, poses: Poses, observed: Observations
) -> np.ndarray:
    """Landmarks (T, 478, 2) px: as detected, or the projected shape where no face was detected."""
    projected = project(to_camera(poses, shape), observed.focal, observed.centre)
    return np.where(detected["valid"][:, None, None], detected["points"][..., :2], projected)


def jaw_outline(
    landmarks: np.ndarray, shape: np.ndarray, poses: Poses, observed: Observations
) -> np.ndarray:
    """Line (T, K, 2) px from left to right along which the head is cut from the neck.

    It is the jaw as detected, without its ends beside the ears. At both ends a point under the ear
    lobe is added, which FaceMesh does not have: it comes from the shape and the pose, so that it
    moves correctly when the head nods.
    """
    ends = shape[[JAW[0], JAW[-1]]]
    lobes = project(to_camera(poses, ends + LOBES), observed.focal, observed.centre)
    return np.concatenate((lobes[:, :1], landmarks[:, list(JAW[1:-1])], lobes[:, 1:]), axis=1)


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
