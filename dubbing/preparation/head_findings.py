"""Poses and masks of a film that were found with the learned head, read from their files.

T frames.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dubbing.errors import PreparationError
from dubbing.preparation.prepared import PreparedClip

POSES_FILE = "poses.npz"
# Masks of what lies over the face, and which frames have one.
COVERS_FILE, COVERED_FILE = "covers.mkv", "covers.npz"
REMEDY = "run with --force refine_poses"


def seen_by_head(clip: PreparedClip, folder: Path) -> PreparedClip:
    """A clip with the poses and masks that were found with the learned head.

    Args:
        folder: that `write_poses` and `find_covers` wrote into.

    Raises:
        PreparationError: there are none, or they are of another clip.
    """
    clip = with_refined_poses(clip, folder)
    names = "over", "covered", "landmarks", "jaw", "grade", "lip_colour"
    kept = _kept(clip, folder / COVERED_FILE, *names)
    found: dict[str, Any] = dict(zip(names, kept, strict=True))
    return replace(clip, overlay=folder / COVERS_FILE, **found)


def with_refined_poses(clip: PreparedClip, folder: Path) -> PreparedClip:
    """A clip with the poses that `write_poses` wrote into a folder.

    Raises:
        PreparationError: there are none, or they are of another clip.
    """
    (c2w,) = _kept(clip, folder / POSES_FILE, "c2w")
    return clip.with_poses(c2w)


def _kept(clip: PreparedClip, file: Path, *names: str) -> list[np.ndarray]:
    """Arrays in a file, each with a row a frame of a clip."""
    try:
        with np.load(file, allow_pickle=False) as kept:
            parts = [kept[name] for name in names]
    except (OSError, ValueError, KeyError) as error:
        what = f"{file.name} cannot be read: {error}"
        raise PreparationError(what, str(file.parent), REMEDY) from error
    for part in parts:
        if len(part) != len(clip):
            what = f"{file.name} is of {len(part)} frames, the clip of {len(clip)}"
            raise PreparationError(what, str(file.parent), REMEDY)
    return parts
