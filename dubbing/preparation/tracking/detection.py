"""From frames to landmarks: the followed face, its crop windows, and its points in every frame.

T frames. Every step returns a dictionary of arrays, which is also written to disk.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.errors import PreparationError
from dubbing.face.finding import chains
from dubbing.face.finding.landmarks import FaceMesh, combine, nearest
from dubbing.media import MediaInfo, read_frames
from dubbing.preparation.crops.film_noise import NoiseMeter
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.crops.tracked_crops import CROPS, create_images
from dubbing.preparation.matting.masks import People
from dubbing.preparation.tracking.cropping import choose_windows, crop, to_crop, within
from dubbing.preparation.tracking.following import strays
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.survey import Survey, survey

BATCH = 8  # frames that the networks look at together
DETECTED, FOLLOWED = 0.3, 0.5  # shares of the work done when all faces are detected, and followed
LEAST_FRAMES = 5

Arrays = dict[str, np.ndarray]


def survey_step(
    info: MediaInfo, first: int, people: Sequence[Portrait], progress: ReportShare
) -> Arrays:
    """Cuts, the followed face's boxes and the crop windows; see :mod:`survey`."""
    result: Survey = survey(info, progress, people, first)
    sizes = (info.width, info.height), float(info.rate)
    window = choose_windows(result.box, result.segment, result.turns, *sizes)
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
    info: MediaInfo, first: int, size: int, surveyed: Arrays, folder: Path, progress: ReportShare
) -> Arrays:
    """Landmarks of every frame in px of its crop; also writes the crops, and the masks of `People`.

    Args:
        info: of the frames. first: of them in the clip.

    Returns:
        points (T, 478, 3), apart (T,) px between the two modes, valid (T,) bool; middle and top
        (T, 2) of a :class:`Silhouette`; noise (T, 5), see `film_noise`.

    Raises:
        PreparationError: hardly any frame has a face.
    """
    segment, window, box = surveyed["segment"], surveyed["window"], surveyed["box"]
    places, source = (
        zip((box[:, :2] + box[:, 2:]) / 2, window, strict=True),
        (info.width, info.height),
    )
    middles = [to_crop(middle, w, size, source) for middle, w in places]
    crops = create_images(folder / CROPS, info.frames, size, size, 3)
    static = FaceMesh(tracking=False, faces=int(surveyed["most_faces"]))
    meter = NoiseMeter(segment, lambda image, t: within(image, window[t]))

    def cropped() -> Iterator[tuple[list[int]]]:
        images = enumerate(read_frames(info.path, start=first, count=info.frames))
        while batch := list(islice(images, BATCH)):
            for t, image in batch:
                crops[t] = crop(image, window[t], size)
                meter.add(t, image)
            yield ([t for t, _ in batch],)

    def detect(frames: list[int]) -> list[np.ndarray | None]:
        found = static.find(crops[frames[0] : frames[-1] + 1])
        return [nearest(faces, middles[t]) for t, faces in zip(frames, found, strict=True)]

    fresh: list[np.ndarray | None] = []
    for some in in_order(detect, cropped()):
        fresh += some
        progress(DETECTED * len(fresh) / info.frames)
    steady: dict[int, np.ndarray | None] = {}
    for followed in in_order(partial(chains.follow, crops, fresh), zip(chains.groups(segment))):
        steady |= followed
        progress(DETECTED + (FOLLOWED - DETECTED) * len(steady) / info.frames)
    combined = [
        combine(steady[t], *rest) for t, rest in enumerate(zip(fresh, middles, strict=True))
    ]
    points, apart, valid = (np.stack(values) for values in zip(*combined, strict=True))
    points, valid = points.astype(np.float32), valid & surveyed["followed"]
    valid &= ~strays(points, valid, segment)
    people, outlines = People(folder, crops), []
    seen = [p if there else None for p, there in zip(points, valid, strict=True)]
    parts = ((k, seen[k : k + BATCH]) for k in range(0, info.frames, BATCH))
    for some in in_order(people.look, parts):
        outlines.append(some)
        progress(FOLLOWED + (1 - FOLLOWED) * len(outlines) * BATCH / info.frames)
    if valid.sum() < LEAST_FRAMES:
        raise PreparationError(
            f"a face in only {int(valid.sum())} of {info.frames} frames",
            str(info.path),
            "use a clip in which the speaker faces the camera",
        )
    middle, top = np.concatenate(outlines, axis=1)
    landmarks = {"points": points, "apart": apart.astype(np.float32), "valid": valid}
    return landmarks | {"middle": middle, "top": top, "noise": meter.noise()}
