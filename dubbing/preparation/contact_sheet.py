"""The contact sheet: source, matte, restored background and pose axes of a few frames."""

from pathlib import Path

import cv2
import numpy as np

from dubbing.engine.disk.files import atomic_write_bytes
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.matting.matting import inpaint_mask
from dubbing.preparation.prepared import PreparedClip

COLUMNS = 8
CELL = 240  # px
AXES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1.5]])  # units of 10 cm, z to the nose
COLOURS = ((230, 60, 60), (60, 200, 60), (70, 110, 255))  # x, y, z
GREEN = np.array([0, 177, 64], np.float32)


def frames_shown(count: int) -> list[int]:
    """Numbers of the frames of so many that a contact sheet shows."""
    return np.unique(np.linspace(0, count - 1, COLUMNS + 2).round().astype(int)[1:-1]).tolist()


def contact_sheet(
    clip: PreparedClip,
    first: int,
    crops: np.ndarray,
    mattes: np.ndarray,
    fills: np.ndarray,
    path: Path,
) -> None:
    """Write the page as PNG: a column a frame, rows source with axes, cut-out head, background.

    Args:
        first: number of the first frame in the source.
        crops: (T, S, S, 3), mattes: (T, S, S) uint8 of all frames.
        fills: (K, S, S, 3) uint8, backgrounds of those of `frames_shown`.
    """
    shown = frames_shown(len(clip))
    jobs = (
        (clip, first, crops[t], mattes[t], fill, t) for t, fill in zip(shown, fills, strict=True)
    )
    columns = list(in_order(column, jobs))
    _, png = cv2.imencode(".png", cv2.cvtColor(np.hstack(columns), cv2.COLOR_RGB2BGR))
    atomic_write_bytes(path, png.tobytes())


def column(
    clip: PreparedClip, first: int, image: np.ndarray, matte: np.ndarray, fill: np.ndarray, t: int
) -> np.ndarray:
    """Images (4 * CELL, CELL, 3) of frame t, one above the other."""
    background = np.where(inpaint_mask(matte)[..., None], fill, image)
    share = matte[..., None].astype(np.float32) / 255
    cut_out = (GREEN + share * (image - GREEN)).round().astype(np.uint8)
    images = (with_axes(image, clip, t), cut_out, np.repeat(matte[..., None], 3, 2), background)
    cells = [cv2.resize(one, (CELL, CELL), interpolation=cv2.INTER_AREA) for one in images]
    text = f"{first + t}" if clip.valid[t] else f"{first + t} no face"
    cv2.putText(
        cells[0], text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA
    )
    return np.vstack(cells)


def with_axes(image: np.ndarray, clip: PreparedClip, t: int) -> np.ndarray:
    """The image with the head's axes and its mean shape drawn in."""
    out = image.copy()
    pose = Poses(clip.rotation[t : t + 1], clip.translation[t : t + 1])
    centre = clip.centre[t : t + 1]
    thick = max(1, clip.size // 150)
    for point in project(to_camera(pose, clip.shape), clip.focal, centre)[0]:
        cv2.circle(out, tuple(point.round().astype(int).tolist()), 1, (120, 255, 120), -1)
    ends = project(to_camera(pose, AXES), clip.focal, centre)[0].round().astype(int).tolist()
    for end, colour in zip(ends[1:], COLOURS, strict=True):
        cv2.arrowedLine(out, ends[0], end, colour, thick, cv2.LINE_AA)
    return out
