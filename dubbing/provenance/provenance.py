"""Labels of an AI-generated video: a visible mark on every frame, and tags in the container."""

from collections.abc import Mapping
from importlib import metadata

import numpy as np
from PIL import Image, ImageDraw, ImageFont

TEXT = "AI-dubbed"
# IPTC's term for a real recording in which a trained model made a part.
SOURCE_TYPE = "http://cv.iptc.org/newscodes/digitalsourcetype/compositeWithTrainedAlgorithmicMedia"
SHARE = 0.026  # height of the letters, of the frame's shorter side
MIN_LETTERS = 11  # px, height of the letters
BACKING, INK = 0.55, 0.95  # opacity of the dark plate and of the white letters


STATEMENT = "AI-generated picture: the face in this video was synthesised to match other speech"
# Of the IPTC's terms those that say that a trained model, or an algorithm, made it or a part.
GENERATED = (
    "algorithmicMedia",
    "algorithmicallyEnhanced",
    "compositeSynthetic",
    "compositeWithTrainedAlgorithmicMedia",
    "trainedAlgorithmicMedia",
)


def tags() -> dict[str, str]:
    """Tags of the container. They are always written; the manifest cannot turn them off."""
    text = f"{STATEMENT} ({made_by()}). Digital source type: {SOURCE_TYPE}"
    return {"comment": text, "description": text, "encoder": made_by()}


def statements(container_tags: Mapping[str, str]) -> dict[str, str]:
    """Those of a container's tags that say that its video is generated, by their keys.

    A tag counts if `tags` of any version wrote it, or if it holds an IPTC term and nothing else.
    Free text about AI does not count: it may say the opposite.
    """
    return {key: text for key, text in container_tags.items() if _says_so(key, text.strip())}


def _says_so(key: str, text: str) -> bool:
    if key.casefold().endswith("digitalsourcetype"):
        folder, _, term = text.rpartition("/")
        named = folder.replace("https:", "http:", 1) in ("", SOURCE_TYPE.rpartition("/")[0])
        return named and term in GENERATED
    begin, end = f"{STATEMENT} (dfrf ", f"). Digital source type: {SOURCE_TYPE}"
    return text.startswith(begin) and text.endswith(end)


def made_by() -> str:
    """This tool and its version."""
    return f"dfrf {metadata.version('dfrf')}"


class VisibleMark:
    """The visible mark in the lower right corner of frames of one size."""

    def __init__(self, width: int, height: int, text: str = TEXT) -> None:
        letters = max(MIN_LETTERS, round(SHARE * min(width, height)))
        plate = _plate(text, letters)
        gap = letters // 2 + 1
        tall, wide = min(plate.shape[0], height), min(plate.shape[1], width)
        top, left = max(0, height - tall - gap), max(0, width - wide - gap)
        self.place = (slice(top, top + tall), slice(left, left + wide))
        self._light, self._cover = plate[:tall, :wide, :1], plate[:tall, :wide, 1:]

    def draw(self, frame: np.ndarray) -> np.ndarray:
        """The frame (H, W, 3) uint8 with the mark; only the pixels of ``place`` change."""
        out = frame.copy()
        below = frame[self.place].astype(np.float32)
        out[self.place] = (below * (1 - self._cover) + 255 * self._light).round()
        return out


def _plate(text: str, letters: int) -> np.ndarray:
    """White letters on a dark round plate: (h, w, 2) float32, light (premultiplied) and opacity."""
    finer = 4  # drawn larger and shrunk, for smooth corners
    font = ImageFont.load_default(size=letters * finer)
    left, top, right, bottom = font.getbbox(text)
    margin = round(0.45 * letters * finer)
    size = (round(right - left) + 3 * margin, round(bottom - top) + 2 * margin)
    plate, ink = Image.new("L", size), Image.new("L", size)
    corners = (0, 0, size[0] - 1, size[1] - 1)
    ImageDraw.Draw(plate).rounded_rectangle(corners, radius=size[1] // 3, fill=255)
    place = (1.5 * margin - left, margin - top)
    ImageDraw.Draw(ink).text(place, text, fill=255, font=font)
    smaller = (max(1, size[0] // finer), max(1, size[1] // finer))
    dark, light = (
        np.asarray(layer.resize(smaller, Image.Resampling.BOX), np.float32) / 255
        for layer in (plate, ink)
    )
    light = light * INK
    return np.stack((light, light + (1 - light) * dark * BACKING), axis=-1)
