"""All that the learned head of a person finds out about a film, as files of one folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dubbing.engine.graph.stage import Progress
from dubbing.heads.covers import find_covers
from dubbing.heads.pose_refinement import refined, write_poses
from dubbing.heads.rendering import load
from dubbing.preparation.prepared import PreparedClip

POSES_SHARE = 0.65  # of the time


def find(model: Path, clip: PreparedClip, out: Path, device: str, progress: Progress) -> None:
    """Writes OUT/poses.npz, covers.mkv and covers.npz.

    Args:
        model: of the person.
        clip: the film, prepared.
        device: auto, cpu or cuda.
    """

    def part(begin: float, end: float) -> Progress:
        return lambda message, share: progress(message, begin + (end - begin) * share)

    head, maps, _ = load(model, device)
    clip = refined(head, maps, clip, np.arange(len(clip)), part(0, POSES_SHARE))
    write_poses(find_covers(head, maps, clip, out, part(POSES_SHARE, 1)), out)
