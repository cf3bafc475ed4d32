"""`prepare`: one clip to its tracked, matted, background-restored form, step by step.

Every step leaves its result in a folder beside the finished files, with the crops and what is seen
of the person in them: 5 bytes a pixel and frame (2 GB a minute at 512 px), until the end. A run
that was killed picks up after the last finished step, and the result is the same bit for bit.
"""

import json
import shutil
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dubbing import json_records
from dubbing.errors import DubbingError, PreparationError
from dubbing.files import atomic_path, atomic_write_json, digest_file, make_folder, note_digest
from dubbing.media import MediaInfo, probe
from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.alignment.score import root_mean_square
from dubbing.preparation.alignment.silhouette import Silhouette
from dubbing.preparation.background.background import background_step
from dubbing.preparation.contact_sheet import contact_sheet
from dubbing.preparation.footage.footage import CROPS, OPACITY, PERSON, Footage, pictures
from dubbing.preparation.matting.masks import matte_step
from dubbing.preparation.prepared import (
    BACKGROUND,
    CONTACT_SHEET,
    MATTE,
    REACH,
    SUMMARY,
    VERSION,
    PreparedClip,
)
from dubbing.preparation.tracking import tracking
from dubbing.preparation.tracking.occlusion import covered_step
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.tracking import Arrays
from dubbing.preparation.tracking.warnings import warnings_of

STEPS, LAYOUT = "steps", 3  # the folder of the steps, and the version of what they leave there
# Shares of the time that the steps take, of 13 s at 512 px.
TIMES = {
    "faces": 0.08,
    "landmarks": 0.34,
    "poses": 0.02,
    "occlusion": 0.02,
    "refinement": 0.14,
    "matte": 0.05,
    "background": 0.35,
}


def prepare(
    clip: Path,
    out: Path,
    *,
    size: int = 512,
    people: Sequence[Portrait] = (),
    progress: Callable[[str, float], None] | None = None,
) -> PreparedClip:
    """Track, matte and restore the background of a clip.

    Args:
        clip: a video of one person who faces the camera most of the time.
        out: folder for track.npz, matte.mkv, background.mkv, contact_sheet.png, prepared.json.
        size: side of the square crop in px, at most; never more than the source shows.
        people: the person to prepare, then the others in the clip; see `survey`.
        progress: called with the name of the step and the share of it that is done.

    Raises:
        DubbingError: `out` cannot be made.
        MediaError: the clip cannot be read.
        PreparationError: no face, or too little of it to work with.
    """
    clip, out = Path(clip), Path(out)
    info = probe(clip)
    if info.picture is None:
        raise PreparationError("no picture in it", str(clip), "give a video file")
    make_folder(out)
    portraits = [[digest_file(person.clip), person.points] for person in people]
    key = {"size": size, "people": json.loads(json.dumps(portraits))}
    steps = Steps(out / STEPS, clip, key, progress or (lambda step, share: None))

    tracked = _track(steps, info, people, size)
    _cut_out(steps, info, tracked, out)
    prepared = _record(clip, out, info, tracked)
    contact_sheet(prepared, out / CONTACT_SHEET)
    prepared.save()
    shutil.rmtree(steps.folder)
    return prepared


@dataclass(frozen=True)
class _Tracked:
    """The head in every frame of a clip (N)."""

    size: int  # side of the crops, px
    seen: Arrays  # of step "faces"
    found: Arrays  # of step "landmarks"
    track: Arrays  # of step "refinement"
    observed: Observations
    covered: np.ndarray  # (N,): something hides the mouth
    poses: Poses
    landmarks: np.ndarray  # (N, 478, 2), px of the crop


def _track(steps: "Steps", info: MediaInfo, people: Sequence[Portrait], most_px: int) -> _Tracked:
    """Landmarks and head poses."""
    seen = steps.run("faces", partial(tracking.survey_step, info, people))
    # A small source keeps its own pixels: enlarging them costs time and shows nothing new.
    size = min(most_px, int(seen["window"][:, 2].max()) // 8 * 8)
    masks = [steps.folder / name for name in (CROPS, PERSON, OPACITY)]
    landmark_step = partial(tracking.landmark_step, info, size, seen, steps.folder)
    found = steps.run("landmarks", landmark_step, *masks)
    observed = tracking.observations(info, size, seen, found)
    bundle = steps.run("poses", partial(tracking.bundle_step, observed, found))
    crops = pictures(steps.folder / CROPS)

    def find_covered(report: Callable[[float], None]) -> Arrays:
        places = found["points"], found["valid"], seen["segment"]
        return covered_step(crops, *places, bundle["shape"], report)

    covered = steps.run("occlusion", find_covered)["covered"]
    observed = replace(observed, silhouette=Silhouette(found["middle"], found["top"]))
    strip = steps.folder / "strip.npy"
    track = steps.run(
        "refinement", partial(tracking.refine_step, observed, found, bundle, crops, strip)
    )
    poses = Poses(track["rotation"], track["translation"])
    landmarks = tracking.filled_landmarks(found, track["shape"], poses, observed)
    return _Tracked(size, seen, found, track, observed, covered, poses, landmarks)


def _cut_out(steps: "Steps", info: MediaInfo, tracked: _Tracked, out: Path) -> None:
    """The head's matte and the background behind it, as files of `out`."""
    seen, landmarks, observed = tracked.seen, tracked.landmarks, tracked.observed
    outline = tracking.jaw_outline(landmarks, tracked.track["shape"], tracked.poses, observed)
    visible = tracking.bridged(tracked.found["valid"], observed.rate)
    masks = pictures(steps.folder / PERSON), pictures(steps.folder / OPACITY)
    places = seen["window"], landmarks, outline, visible, seen["segment"]
    footage = Footage(info, pictures(steps.folder / CROPS), *masks, *places)
    matte, background = out / MATTE, out / BACKGROUND

    def write_matte(report: Callable[[float], None]) -> Arrays:
        matte_step(footage, matte, report)
        return {}

    def write_background(report: Callable[[float], None]) -> Arrays:
        background_step(footage, matte, background, report)
        return {}

    steps.run("matte", write_matte, matte)
    steps.run("background", write_background, background)


def _record(clip: Path, out: Path, info: MediaInfo, tracked: _Tracked) -> PreparedClip:
    """What later stages read of the clip."""
    seen, observed, poses = tracked.seen, tracked.observed, tracked.poses
    found = tracked.found | {"covered": tracked.covered}
    distance = np.linalg.norm(poses.translation, axis=1)[found["valid"]]
    return PreparedClip(
        folder=out,
        clip=clip.resolve(),
        rate=info.rate,
        frames_count=info.frames,
        size=tracked.size,
        source_size=(info.width, info.height),
        focal=observed.focal,
        near=float(distance.min() - REACH),
        far=float(distance.max() + REACH),
        warnings=warnings_of(info, tracked.size, seen, found, poses),
        residual_shift=root_mean_square(tracked.track["residual_shift"]),
        rotation=poses.rotation,
        translation=poses.translation,
        centre=observed.centre,
        crop=seen["window"],
        valid=found["valid"],
        covered=tracked.covered,
        segment=seen["segment"],
        landmarks=tracked.landmarks.astype(np.float32),
        shape=tracked.track["shape"],
    )


def _key(path: Path) -> dict[str, Any]:
    """The key of the steps in a folder; empty where there is none."""
    try:
        return json_records.read(path, dict[str, Any], "key of the steps")
    except DubbingError:
        return {}


class Steps:
    """Steps whose arrays lie in a folder, each a file that appears whole.

    Steps of another clip, version or with other settings are thrown away.
    """

    def __init__(
        self,
        folder: Path,
        clip: Path,
        settings: Mapping[str, Any],
        progress: Callable[[str, float], None],
    ) -> None:
        self.folder, self._clip, self._report = folder, clip, progress
        key = {"clip": digest_file(clip), **settings, "version": VERSION, "layout": LAYOUT}
        key_file = folder / "key.json"
        if _key(key_file) != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            (folder.parent / SUMMARY).unlink(missing_ok=True)
            atomic_write_json(key_file, key)

    def run(
        self, name: str, step: Callable[[Callable[[float], None]], Arrays], *beside: Path
    ) -> Arrays:
        """The arrays of a step: read if it was finished, else computed and written.

        Args:
            beside: other files that it writes.

        Raises:
            PreparationError: no head explains what was found.
        """
        path = self.folder / f"{name}.npz"
        arrays = _stored(path) if all(file.is_file() for file in beside) else None
        if arrays is None:
            try:
                arrays = step(partial(self._progress, name))
            except np.linalg.LinAlgError as error:  # something that only looked like a face
                raise PreparationError(
                    f"what looks like a face is none that can be followed ({name}: {error})",
                    str(self._clip),
                    "use a clip in which one person faces the camera",
                ) from error
            for file in beside:
                note_digest(file)
            with atomic_path(path) as temporary:
                np.savez(temporary, allow_pickle=False, **arrays)
        self._progress(name, 1.0)
        return arrays

    def _progress(self, name: str, share: float) -> None:
        """Report how much of all steps is done, where a share of one is."""
        steps = [*TIMES]
        before = sum(TIMES[step] for step in steps[: steps.index(name)])
        self._report(name, min(1.0, before + TIMES[name] * share))


def _stored(path: Path) -> Arrays | None:
    """The arrays of a finished step; None where there are none, or their checksums are wrong."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {key: stored[key] for key in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None
