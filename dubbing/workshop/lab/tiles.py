"""Images of held-out frames: the source above what each method makes of it.

S is the side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dubbing.engine.disk.files import atomic_write_bytes
from dubbing.identity.dataset import mouth_boxes
from dubbing.preparation.prepared import PreparedClip

TILES_FILE, METHODS_FILE = "tiles.png", "methods.png"
TILES = 20  # of a method, about
COLUMNS = 6  # of them beside other methods
SIDE = 256  # px of an image beside other methods
STRIP = 160  # px, height of a mouth beside other methods
AROUND = 1.1  # width of a strip, in mouth boxes


def tile_frames(first: int, count: int, every: int = 1) -> range:
    """Which of the frames first .. first + count get a tile, if one of so many is tested."""
    tested = -(-count // every)
    return range(first, first + count, every * max(1, tested // TILES))


def write_tiles(folder: Path, tiles: Sequence[np.ndarray]) -> None:
    """FOLDER/tiles.png from images (R S, S, 3) of these frames, source above render."""
    _write(folder / TILES_FILE, np.concatenate(tiles, 1))


def write_methods(latest: Path, clip: PreparedClip, first: int, count: int, every: int = 1) -> None:
    """Writes methods.png: some of these frames and their mouths, of the source and of every method.

    Args:
        latest: folder of the method just measured, named after it. It lies beside the others', and
            the picture beside it; a method with tiles of other frames is left out.
        clip, first, count, every: what it was measured on.
    """
    folder = latest.parent
    rows = {"source": _read(latest)[: clip.size]}
    for tiles in sorted(folder.glob(f"*/{TILES_FILE}")):
        both = _read(tiles.parent)
        if np.array_equal(both[: clip.size], rows["source"]):
            rows[tiles.parent.name] = both[clip.size :]
    frames = np.array(tile_frames(first, count, every))
    some = np.unique(np.linspace(0, len(frames) - 1, COLUMNS).round().astype(int))
    boxes = mouth_boxes(clip.landmarks[frames[some]], clip.size)
    faces, mouths = [], []
    for name, row in rows.items():
        images = [row[:, k * clip.size : (k + 1) * clip.size] for k in some]
        small = [cv2.resize(p, (SIDE, SIDE), interpolation=cv2.INTER_AREA) for p in images]
        faces.append(_named(np.concatenate(small, 1), name))
        strip = np.concatenate(
            [_mouth(p, box, boxes) for p, box in zip(images, boxes, strict=True)], 1
        )
        mouths.append(_named(strip, name))
    _write(folder / METHODS_FILE, np.concatenate([*faces, *mouths]))


def _mouth(image: np.ndarray, box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """The mouth of an image, (STRIP, SIDE, 3), at the scale of the widest of some boxes (C, 4)."""
    width = AROUND * float((boxes[:, 2] - boxes[:, 0]).max())
    scale = SIDE / max(width, 1.0)
    middle = (box[:2] + box[2:]) / 2
    move = np.array([SIDE / 2, STRIP / 2]) - scale * middle
    to_strip = np.array([[scale, 0, move[0]], [0, scale, move[1]]])
    return cv2.warpAffine(image, to_strip, (SIDE, STRIP), flags=cv2.INTER_CUBIC)


def _named(row: np.ndarray, name: str) -> np.ndarray:
    """A row of images with its name in its corner."""
    row = np.ascontiguousarray(row)
    for colour, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(
            row, name, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, thickness, cv2.LINE_AA
        )
    return row


def _read(folder: Path) -> np.ndarray:
    """The image that `write_tiles` wrote, (2 S, W, 3)."""
    image = cv2.imread(str(folder / TILES_FILE))
    if image is None:
        raise OSError(f"{folder / TILES_FILE} is no image")
    return image[..., ::-1]


def _write(path: Path, image: np.ndarray) -> None:
    """An RGB image, whole or not at all."""
    atomic_write_bytes(path, cv2.imencode(".png", image[..., ::-1])[1].tobytes())
