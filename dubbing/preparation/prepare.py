"""`prepare`: tracks a clip, mattes the head and restores the background, step by step.

Every step writes its result into a folder beside the finished files, with the crops and person
masks: 6 bytes a pixel and frame (2.4 GB a minute at 512 px), until the end. A run that was killed
resumes after the last finished step, and the result is the same bit for bit.
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import make_folder
from dubbing.engine.graph.stage import Progress, ReportShare
from dubbing.errors import PreparationError
from dubbing.media import MediaInfo, probe
from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.alignment.score import root_mean_square
from dubbing.preparation.alignment.silhouette import Silhouette
from dubbing.preparation.background.background import background_step
from dubbing.preparation.contact_sheet import contact_sheet, frames_shown
from dubbing.preparation.covering.light import noticed
from dubbing.preparation.covering.occlusion import covered_step
from dubbing.preparation.covering.overlay import Overlay, overlay_step
from dubbing.preparation.covering.still_graphics import StillGraphics
from dubbing.preparation.crops.tracked_crops import (
    ALPHA,
    CROPS,
    OPACITY,
    PERSON,
    TrackedCrops,
    open_images,
)
from dubbing.preparation.file_names import CONTACT_SHEET
from dubbing.preparation.matting.masks import matte_step
from dubbing.preparation.prepared import BACKGROUND, HEAD_RADIUS, MATTE, OVERLAY, PreparedClip
from dubbing.preparation.steps import STEPS, Steps
from dubbing.preparation.tracking import detection, tracking
from dubbing.preparation.tracking.cut_line import jaw_outline
from dubbing.preparation.tracking.detection import Arrays
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.reach import views_of
from dubbing.preparation.tracking.warnings import face_warnings_of, warnings_of
from dubbing.preparation.turning.head_surface import HeadSurface
from dubbing.preparation.turning.profile_lips import LipShapes, Profiles, told_lengths
from dubbing.preparation.turning.profile_outline import outlined
from dubbing.preparation.turning.turned import Footage, angles, turned_step
from dubbing.preparation.turning.turned_landmarks import filled_landmarks


def prepare(
    clip: Path,
    out: Path,
    *,
    size: int = 1024,
    people: Sequence[Portrait] = (),
    part: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> PreparedClip:
    """Track, matte and restore the background of a clip.

    Args:
        clip: a video of one person who faces the camera most of the time.
        out: folder for track.npz, matte.mkv, background.mkv, overlay.mkv, contact_sheet.png and
            prepared.json.
        size: largest side of the square crop in px; never more than the source's resolution.
        people: the person to prepare, then the others in the clip; see `survey`.
        part: the only frames, first .. stop, that are prepared; all by default.
        progress: called with the name of the step and the share of all that is done.

    Raises:
        ExplainedError: `out` cannot be made.
        MediaError: the clip cannot be read.
        PreparationError: no face, or too little of it to work with.
    """
    clip, out = Path(clip), Path(out)
    info = probe(clip)
    if info.picture is None:
        raise PreparationError("no picture in it", str(clip), "give a video file")
    first, stop = part or (0, info.frames)
    film, info = info, replace(info, frames=stop - first)
    make_folder(out)
    portraits = [[digest_of(person.clip), person.points] for person in people]
    key = {"size": size, "people": json.loads(json.dumps(portraits)), "part": [first, stop]}
    steps = Steps(out / STEPS, clip, key, progress or (lambda step, share: None))

    tracked = _track(steps, info, first, people, size, out / OVERLAY)
    images = _cut_out(steps, info, tracked, out)
    prepared = _record(clip, out, info, first, tracked)
    contact_sheet(prepared, first, *images, out / CONTACT_SHEET)
    prepared = prepared.within(first, film.frames)
    prepared.save()
    shutil.rmtree(steps.folder)
    return prepared


@dataclass(frozen=True)
class _Tracked:
    """The head in every frame of a clip (N)."""

    size: int  # side of the crops, px
    surveyed: Arrays  # of step "faces"
    detected: Arrays  # of step "landmarks"
    track: Arrays  # of step "refinement"
    observed: Observations
    light: Arrays  # of step "occlusion": covered (N,), and gain and offset of the light
    over: np.ndarray  # (N,): something lies over a part of the face
    poses: Poses
    known: np.ndarray  # (N,): the head is seen, and its pose is known
    landmarks: np.ndarray  # (N, 478, 2), px of the crop
    lip_shift: np.ndarray  # (N, 40, 2)


def _track(
    steps: Steps,
    info: MediaInfo,
    first: int,
    people: Sequence[Portrait],
    most_px: int,
    overlay: Path,
) -> _Tracked:
    """Landmarks and head poses; masks of things over the face are written to a file.

    Args:
        info: of the frames that are prepared. first: of them in the clip.
    """
    surveyed = steps.run("faces", partial(detection.survey_step, info, first, people))
    # A small source keeps its own pixels: enlarging them costs time and adds nothing.
    size = min(most_px, int(surveyed["window"][:, 2].max()))
    masks = [steps.folder / name for name in (CROPS, PERSON, OPACITY)]
    landmark_step = partial(detection.landmark_step, info, first, size, surveyed, steps.folder)
    detected = steps.run("landmarks", landmark_step, *masks)
    observed = tracking.observations(info, size, surveyed, detected)
    segment = surveyed["segment"]
    bundle = steps.run("poses", partial(tracking.trusted_step, observed, detected, segment))
    places = detected["points"], detected["valid"], segment
    crops = open_images(steps.folder / CROPS)

    def find_covered(report: ReportShare) -> Arrays:
        views = views_of(bundle["rotation"], bundle["translation"])
        return covered_step(crops, *places, bundle["shape"], views, report)

    def find_overlay(report: ReportShare) -> Arrays:
        graphics = StillGraphics(crops, places[0], surveyed["window"], *places[1:])
        colours = Overlay(crops, *places, bundle["shape"], light)
        return overlay_step(colours, graphics, overlay, info, report)

    light = steps.run("occlusion", find_covered)
    over = steps.run("overlay", find_overlay, overlay)["over"]
    observed = replace(observed, silhouette=Silhouette(detected["middle"], detected["top"]))
    strip = steps.folder / "strip.npy"
    sure = tracking.only(observed, bundle["trusted"])
    track = steps.run(
        "refinement", partial(tracking.refine_step, sure, detected, bundle, crops, strip)
    )
    surface = HeadSurface(track["shape"], observed.focal)
    footage = Footage(crops, open_images(masks[1]), observed.centre, segment, surface)
    turned = steps.run("turned", partial(turned_step, bundle, track, footage))
    shape, poses = track["shape"], Poses(turned["rotation"], turned["translation"])
    known = turned["known"] & surveyed["followed"]
    turn, front = np.where(known, angles(poses), np.nan), bundle["trusted"]
    own_shape, own_poses = outlined(shape, poses, turn, footage)
    mean_face = project(to_camera(own_poses, own_shape), observed.focal, observed.centre)
    shapes = LipShapes.of(detected["points"][front], own_shape)
    lengths = told_lengths(detected["points"], detected["valid"], own_shape)
    profiles = Profiles(crops, mean_face, turn, lengths, front)
    lips = steps.run("lips", partial(profiles.lips_step, info, first))["lips"]
    read = np.isfinite(lips).all(1)
    detected["valid"] |= read
    if read.any():  # where landmarks tell all lips, these lie on the face that fits landmarks
        shape, poses = own_shape, own_poses
    landmarks, lip_shift = filled_landmarks(
        detected, front, shape, poses, observed, shapes.changes(lips)
    )
    track = track | {"shape": shape}
    return _Tracked(
        size, surveyed, detected, track, observed, light, over, poses, known, landmarks, lip_shift
    )


def _cut_out(
    steps: Steps, info: MediaInfo, tracked: _Tracked, out: Path
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write the head's matte and the background behind it into `out`.

    Returns:
        Crops, mattes and backgrounds for the contact sheet.
    """
    surveyed, landmarks, observed = tracked.surveyed, tracked.landmarks, tracked.observed
    shape, poses = tracked.track["shape"], tracked.poses
    outline = jaw_outline(landmarks, shape, poses, observed, tracked.size)
    visible = tracking.bridged(tracked.known, observed.rate)
    masks = open_images(steps.folder / PERSON), open_images(steps.folder / OPACITY)
    places = surveyed["window"], landmarks, outline, visible, surveyed["segment"]
    light = noticed(tracked.light["gain"], tracked.light["offset"])
    crops = TrackedCrops(info, open_images(steps.folder / CROPS), *masks, *places, *light)
    matte, background, alphas = out / MATTE, out / BACKGROUND, steps.folder / ALPHA

    def write_matte(report: ReportShare) -> Arrays:
        matte_step(crops, matte, alphas, report)
        return {}

    def write_background(report: ReportShare) -> Arrays:
        shown = frames_shown(len(crops))
        return {"shown": background_step(crops, open_images(alphas), shown, background, report)}

    steps.run("matte", write_matte, matte, alphas)
    shown = steps.run("background", write_background, background)["shown"]
    return crops.crops, open_images(alphas), shown


def _record(clip: Path, out: Path, info: MediaInfo, first: int, tracked: _Tracked) -> PreparedClip:
    """The prepared clip that later stages read, of its own frames alone."""
    surveyed, observed, poses = tracked.surveyed, tracked.observed, tracked.poses
    detected = tracked.detected | {"covered": tracked.light["covered"], "over": tracked.over}
    detected |= {"valid": tracked.known, "points": tracked.landmarks}
    distance = np.linalg.norm(poses.translation, axis=1)[tracked.known]
    return PreparedClip(
        folder=out,
        clip=clip.resolve(),
        rate=info.rate,
        frames_count=info.frames,
        part=(0, info.frames),
        size=tracked.size,
        source_size=(info.width, info.height),
        focal=observed.focal,
        near=float(distance.min() - HEAD_RADIUS),
        far=float(distance.max() + HEAD_RADIUS),
        warnings=warnings_of(info, first, tracked.size, surveyed, detected, poses),
        face_warnings=face_warnings_of(info, first, surveyed),
        residual_shift=root_mean_square(tracked.track["residual_shift"]),
        rotation=poses.rotation,
        translation=poses.translation,
        centre=observed.centre,
        crop=surveyed["window"],
        valid=tracked.known,
        detected=tracked.detected["valid"] & tracked.known,
        covered=tracked.light["covered"],
        over=tracked.over,
        segment=surveyed["segment"],
        shown=surveyed["shown"],
        haze=tracked.light["offset"],
        noise=tracked.detected["noise"],
        landmarks=tracked.landmarks.astype(np.float32),
        lip_shift=tracked.lip_shift.astype(np.float32),
        shape=tracked.track["shape"],
    )
