"""How the check answers to a degraded video: the mouth blurred, and the mouth frozen.

    python -m dubbing.workshop.training.sync.degradation CLIP...

The closeness must fall from line to line, and a frozen mouth must fail.

Letters: H and W pixels.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from dubbing import media
from dubbing.face.face_tracker import FaceTracker
from dubbing.face.mouth_shape import CHIN, MOUTH, OUTER_LIP, RIGID
from dubbing.sync.check import check
from dubbing.sync.result import SyncResult

Change = Callable[[np.ndarray, np.ndarray], np.ndarray]

# Standard deviations of the blur in widths of the mouth.
BLURS = (0.05, 0.1, 0.2)
# The changed region: the hull of lips and chin, this much larger, feathered.
GROWTH = 1.25
FEATHER = 0.15


def mouth_mask(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Soft mask (H, W) float32 over lips and chin of a mesh (478, 3)."""
    region = points[list(MOUTH), :2]
    hull = cv2.convexHull((region.mean(0) + GROWTH * (region - region.mean(0))).astype(np.float32))
    mask = np.zeros(shape, np.float32)
    cv2.fillConvexPoly(mask, np.round(hull).astype(np.int32), 1.0)
    return cv2.GaussianBlur(mask, (0, 0), FEATHER * mouth_width(points))


def mouth_width(points: np.ndarray) -> float:
    """Pixels between the outermost points of the lips."""
    return max(1.0, float(np.ptp(points[list(OUTER_LIP), 0])))


def blurred(frame: np.ndarray, points: np.ndarray, amount: float) -> np.ndarray:
    """The frame with its mouth blurred by `amount` mouth widths."""
    soft = cv2.GaussianBlur(frame, (0, 0), amount * mouth_width(points))
    mask = mouth_mask(points, frame.shape[:2])[..., None]
    return np.round(frame + mask * (soft.astype(np.float32) - frame)).astype(np.uint8)


class Freezer:
    """Puts the mouth of the first frame over every later one, following the head."""

    def __init__(self) -> None:
        self._first: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, frame: np.ndarray, points: np.ndarray) -> np.ndarray:
        if self._first is None:
            self._first = frame, points
        image, mesh = self._first
        rigid = list(RIGID)
        move, _ = cv2.estimateAffinePartial2D(mesh[rigid, :2], points[rigid, :2])
        size = (frame.shape[1], frame.shape[0])
        laid = cv2.warpAffine(image, move, size, borderMode=cv2.BORDER_REPLICATE)
        both = np.concatenate([points[:, :2], mesh[:, :2] @ move[:, :2].T + move[:, 2]])
        # The chin of an open mouth reaches lower than the frozen one: cover both.
        lowest = both[[*CHIN, *(p + len(points) for p in CHIN)], 1].max()
        region = points.copy()
        region[list(CHIN), 1] = np.maximum(region[list(CHIN), 1], lowest)
        mask = mouth_mask(region, frame.shape[:2])[..., None]
        return np.round(frame + mask * (laid.astype(np.float32) - frame)).astype(np.uint8)


def changed(clip: Path, count: int, rate: float, change: Change) -> Iterator[np.ndarray]:
    """The first `count` frames of a clip, changed where a face is found."""
    tracker = FaceTracker(rate, max_faces=1)
    for frame in media.read_frames(clip, count=count):
        faces = tracker(frame)
        yield change(frame, faces[0].points) if faces else frame


def changes() -> dict[str, Change]:
    """Names of the changes, mildest first, and a fresh function for each."""
    by_name: dict[str, Change] = {"source": lambda frame, _: frame}
    for amount in BLURS:
        by_name[f"mouth blurred, {amount} widths"] = partial(blurred, amount=amount)
    by_name["mouth frozen"] = Freezer()
    return by_name


def table(clips: Sequence[Path], seconds: float) -> str:
    """Markdown: offset, confidence and verdict of every clip and change."""
    lines = ["| clip | picture | offset | confidence | closeness | verdict |"]
    lines.append("|---|---|---|---|---|---|")
    for clip in clips:
        source = None
        for name, change in changes().items():
            result = check_changed(clip, seconds, change, source)
            source = source or result
            near = f"{result.closeness:.2f}" if result.closeness is not None else ""
            cells = [clip.stem, name, f"{result.offset_frames}", f"{result.confidence or 0:.3f}"]
            lines.append(f"| {' | '.join([*cells, near, result.verdict])} |")
    return "\n".join(lines)


def check_changed(
    clip: Path, seconds: float, change: Change, source: SyncResult | None
) -> SyncResult:
    """The check of the clip's beginning with changed frames and its own sound."""
    info = media.probe(clip)
    with tempfile.TemporaryDirectory() as folder:
        video = Path(folder) / "changed.mp4"
        with media.VideoWriter(video, info.width, info.height, info.rate) as writer:
            for frame in changed(clip, round(seconds * info.rate), float(info.rate), change):
                writer.write(frame)
        return check(video, sound_from=clip, source=source)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0)
    chosen = parser.parse_args(arguments)
    print(table(chosen.clips, chosen.seconds))


if __name__ == "__main__":
    main()
