"""From frames to head poses: landmarks, mean shape, bundle adjustment, photometric refinement.

T frames. Every step returns a dictionary of arrays, which is also what it leaves on the disk.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from dubbing.errors import PreparationError
from dubbing.face.landmarks import TwoModes, two_modes
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
from dubbing.preparation.footage.footage import CROPS, new_pictures
from dubbing.preparation.footage.threads import in_order
from dubbing.preparation.matting.masks import People
from dubbing.preparation.matting.person_masks import PersonMasks
from dubbing.preparation.tracking.cropping import choose_windows, crop, to_crop
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.procrustes import head_frame, mean_shape
from dubbing.preparation.tracking.survey import Survey, survey

APART = 3.0  # px at a crop of 512: tracking and static mode disagree, something is in the way
HIDDEN = 2.0  # times as much: the frame is not used at all
BRIDGE_SECONDS = 0.5  # smoothness carries a pose over gaps no longer than this
SHAPE_FRAMES = 250
RELIEF_FRAMES = 150
LEAST_FRAMES = 5
# From the ends of the jaw line to below the ear lobes, in units of 10 cm: out, down and back.
LOBES = np.array([[-0.12, 0.1, 0.45], [0.12, 0.1, 0.45]])

Arrays = dict[str, np.ndarray]
Progress = Callable[[float], None]


def survey_step(info: MediaInfo, people: Sequence[Portrait], progress: Progress) -> Arrays:
    """Cuts, the followed face's boxes and the crop windows; see :mod:`survey`."""
    seen: Survey = survey(info, progress, people)
    window = choose_windows(seen.box, seen.segment, (info.width, info.height), float(info.rate))
    return {
        "segment": seen.segment,
        "repeated": seen.repeated,
        "shown": seen.shown,
        "box": seen.box,
        "distance": seen.distance,
        "followed": np.isfinite(seen.distance)[seen.segment],
        "window": window,
        "most_faces": np.array(seen.most_faces),
        "other": seen.other,
    }


def landmark_step(
    info: MediaInfo, size: int, seen: Arrays, folder: Path, progress: Progress
) -> Arrays:
    """Landmarks of every frame in px of its crop; the crops and what `People` finds are left there.

    Faces are followed from frame to frame, one after the other; threads look at the frames before.

    Returns:
        points (T, 478, 3), apart (T,) px between the two modes, valid (T,) bool; middle and top
        (T, 2) of a :class:`Silhouette`.

    Raises:
        PreparationError: hardly any frame has a face.
    """
    segment, window, box = seen["segment"], seen["window"], seen["box"]
    points = np.zeros((info.frames, 478, 3), np.float32)
    apart, valid = np.zeros(info.frames, np.float32), np.zeros(info.frames, bool)
    crops = new_pictures(folder / CROPS, info.frames, size, size, 3)

    def followed(detect: TwoModes) -> Iterator[tuple[int, np.ndarray | None]]:
        for t, image in enumerate(read_frames(info.path)):
            if t and segment[t] != segment[t - 1]:
                detect.restart()
            middle = to_crop((box[t, :2] + box[t, 2:]) / 2, window[t], size)
            crops[t] = part = crop(image, window[t], size)
            points[t], apart[t], valid[t] = detect(part, middle)
            valid[t] &= seen["followed"][t]
            yield t, points[t] if valid[t] else None
            progress((t + 1) / info.frames)

    with two_modes(int(seen["most_faces"])) as detect, PersonMasks() as person_masks:
        people = People(folder, crops, person_masks)
        outlines = np.stack(list(in_order(people.look, followed(detect))), axis=1)
    if valid.sum() < LEAST_FRAMES:
        raise PreparationError(
            f"a face in only {int(valid.sum())} of {info.frames} frames",
            str(info.path),
            "use a clip in which the speaker faces the camera",
        )
    found = {"points": points, "apart": apart, "valid": valid}
    return found | dict(zip(("middle", "top"), outlines, strict=True))


def principal_points(window: np.ndarray, source_size: tuple[int, int], size: int) -> np.ndarray:
    """Middle of the full frame in px of every crop: (T, 2) for windows (T, 3)."""
    middle = (np.array(source_size) - 1) / 2
    return np.stack([to_crop(middle, w, size) for w in window])


def observations(info: MediaInfo, size: int, seen: Arrays, found: Arrays) -> Observations:
    """What the bundle adjustment sees: rigid points weighed by how well the two modes agree."""
    apart = np.maximum(found["apart"] / (APART * size / 512), 1)
    confidence = np.where(found["valid"] & (apart < HIDDEN), 1 / apart**2, 0)
    if not confidence.any():  # a film so blurred that the modes never agree
        confidence = found["valid"].astype(np.float64)
    return Observations(
        pixels=found["points"][:, list(RIGID), :2].astype(np.float64),
        confidence=confidence,
        linked=second_difference_links(
            seen["segment"], bridged(confidence > 0, float(info.rate)), seen["repeated"]
        ),
        focal=focal_length(seen["window"], (info.width, info.height), size),
        centre=principal_points(seen["window"], (info.width, info.height), size),
        rate=float(info.rate),
    )


def bridged(usable: np.ndarray, rate: float) -> np.ndarray:
    """Frames (T,) bool that are usable or lie in a gap of at most half a second."""
    out = usable.copy()
    index = np.flatnonzero(usable)
    for before, after in itertools.pairwise(index):
        if after - before - 1 <= BRIDGE_SECONDS * rate:
            out[before:after] = True
    return out


def bundle_step(seen: Observations, found: Arrays, progress: Progress) -> Arrays:
    """Mean shape, and poses that fit it to the landmarks.

    The shape stays what FaceMesh makes of the face: solved from landmarks together with the poses
    it grows flat, as these follow a turn by too much.

    Returns:
        shape (478, 3) in the head frame, rotation (T, 3, 3), translation (T, 3).
    """
    some = seen.spread(SHAPE_FRAMES)
    shape = head_frame(mean_shape(found["points"][some].astype(np.float64), RIGID))
    progress(0.3)
    rigid = shape[list(RIGID)]
    poses = fit_poses(rigid, start_poses(rigid, seen), seen)
    progress(1.0)
    return {"shape": shape, "rotation": poses.rotation, "translation": poses.translation}


def filled_landmarks(
    found: Arrays, shape: np.ndarray, poses: Poses, seen: Observations
) -> np.ndarray:
    """Landmarks (T, 478, 2) px: as detected, or the projected shape where no face was found."""
    projected = project(to_camera(poses, shape), seen.focal, seen.centre)
    return np.where(found["valid"][:, None, None], found["points"][..., :2], projected)


def jaw_outline(
    landmarks: np.ndarray, shape: np.ndarray, poses: Poses, seen: Observations
) -> np.ndarray:
    """Line (T, K, 2) px from left to right along which the head is cut from the neck.

    The jaw as detected, without its ends beside the ears, and to both sides of it the place under
    the ear lobe, which FaceMesh does not know: from the shape and the pose, so that it moves
    rightly when the head nods.
    """
    ends = shape[[JAW[0], JAW[-1]]]
    lobes = project(to_camera(poses, ends + LOBES), seen.focal, seen.centre)
    return np.concatenate((lobes[:, :1], landmarks[:, list(JAW[1:-1])], lobes[:, 1:]), axis=1)


def refine_step(
    observed: Observations,
    found: Arrays,
    bundle: Arrays,
    crops: np.ndarray,
    scratch: Path,
    progress: Progress,
) -> Arrays:
    """Poses refined by the pixels, the shape from them, and the score of the track.

    Args:
        crops: (T, S, S, 3). scratch: a file to keep their faces in while they are needed.

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
    shape = triangulate(shape, found["points"][:, :, :2].astype(np.float64), poses, observed)
    # Scored on points that took no part in the alignment.
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
