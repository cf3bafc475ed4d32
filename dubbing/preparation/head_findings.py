"""Poses and masks of a film that were found with the learned head, read from their files.

T frames.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from dubbing.errors import PreparationError
from dubbing.preparation.prepared import PreparedClip

POSES_FILE = "poses.npz"
# Masks of what lies over the face, and which frames have one.
COVERS_FILE, COVERED_FILE = "covers.mkv", "covers.npz"


def seen_by_head(clip: PreparedClip, folder: Path) -> PreparedClip:
    """A clip with the poses and masks that were found with the learned head.

    Args:
        folder: that `write_poses` and `find_covers` wrote into.

    Raises:
        PreparationError: there are none, or they are of another clip.
    """
    clip = with_refined_poses(clip, folder)
    try:
        with np.load(folder / COVERED_FILE, allow_pickle=False) as kept:
            parts = {name: kept[name] for name in ("over", "covered", "landmarks")}
    except (OSError, ValueError, KeyError) as error:
        what = f"no masks of what lies over the face: {error}"
        raise PreparationError(what, str(folder), "run with --force refine_poses") from error
    if len(parts["over"]) != len(clip):
        what = f"masks of {len(parts['over'])} frames for a clip of {len(clip)}"
        raise PreparationError(what, str(folder), "run with --force refine_poses")
    return replace(clip, overlay=folder / COVERS_FILE, **parts)


def with_refined_poses(clip: PreparedClip, folder: Path) -> PreparedClip:
    """A clip with the poses that `write_poses` wrote into a folder.

    Raises:
        PreparationError: there are none, or they are of another clip.
    """
    try:
        with np.load(folder / POSES_FILE, allow_pickle=False) as kept:
            c2w = kept["c2w"]
    except (OSError, ValueError, KeyError) as error:
        what = f"no refined poses: {error}"
        raise PreparationError(what, str(folder), "run with --force refine_poses") from error
    if c2w.shape != (len(clip), 3, 4):
        what = f"poses of {len(c2w)} frames for a clip of {len(clip)}"
        raise PreparationError(what, str(folder), "run with --force refine_poses")
    return clip.with_poses(c2w)
