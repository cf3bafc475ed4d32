"""A little film with texture and motion, to be marked and mistreated."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from dubbing import media
from dubbing.provenance.mark import Mark
from dubbing.provenance.mark_key import bits_of
from tests import clips

KEY = bytes(range(32))
ID = "0123456789abcdef"
SIZE = (640, 480)
RATE = Fraction(25)
FACE = (slice(180, 360), slice(200, 400))  # rows and columns that a dub replaces


def frames(count: int, size: tuple[int, int] = SIZE, seed: int = 0) -> list[np.ndarray]:
    """A still room of several scales of detail, before which something textured moves."""
    width, height = size
    rng = np.random.default_rng(seed)
    room = np.full((height, width), 110.0, np.float32)
    for fineness, strength in ((2, 12), (8, 60), (40, 300)):
        noise = rng.normal(0, 1, (height, width)).astype(np.float32)
        room += strength * cv2.GaussianBlur(noise, (0, 0), fineness)
    side = height // 3
    thing = 120 + 90 * cv2.GaussianBlur(rng.normal(0, 1, (side, side)), (0, 0), 3)
    made = []
    for k in range(count):
        picture = room.copy()
        top, left = height // 3, width // 3 + 2 * k
        picture[top : top + side, left : left + side] = thing
        noisy = picture + rng.normal(0, 1, picture.shape)
        tinted = noisy[..., None] + np.array([8, 0, -8])
        made.append(np.clip(tinted, 0, 255).round().astype(np.uint8))
    return made


def marked(film: list[np.ndarray], key: bytes = KEY) -> list[np.ndarray]:
    """The same frames with the mark on what a dub replaces."""
    height, width, _ = film[0].shape
    mark = Mark(key, bits_of(ID), width, height, RATE)
    replaced = np.zeros((height, width), np.uint8)
    replaced[FACE] = 255
    return [mark.draw(frame, replaced, number) for number, frame in enumerate(film)]


def write(path: Path, film: list[np.ndarray]) -> Path:
    """The frames as the tool encodes them."""
    height, width, _ = film[0].shape
    with media.VideoWriter(path, width, height, RATE) as writer:
        for frame in film:
            writer.write(frame)
    return path


def treated(path: Path, *options: str) -> Path:
    """The file as ffmpeg makes it again with these options."""
    out = path.with_name(f"treated{len(list(path.parent.iterdir()))}.mp4")
    clips.ffmpeg("-i", path, *options, out)
    return out
