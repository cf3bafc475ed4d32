"""All that the learned head of a person finds out about a film, as files of one folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from dfrf import saved_models
from dfrf.field.reference_maps import ReferenceMaps
from dubbing.engine.stage import Progress
from dubbing.heads.covers import find_covers
from dubbing.heads.film_views import VIEWS_FILE, views_of_film
from dubbing.heads.pose_refinement import refined, write_poses
from dubbing.heads.rendering import load
from dubbing.identity.learned import Learned
from dubbing.preparation.prepared import PreparedClip

PICTURES_FOLDER = "pictures"  # of the film's frames, while its views are chosen
POSES_SHARE, COVERS_SHARE = 0.6, 0.9  # of the time that is over after each part


def find(
    model: Path, clip: PreparedClip, learned: Learned, out: Path, device: str, progress: Progress
) -> None:
    """Writes OUT/poses.npz, covers.mkv, covers.npz and views.safetensors.

    Args:
        model: of the person. learned: seconds of clips that it was learned from.
        clip: the film, prepared.
        device: auto, cpu or cuda.
        progress: called with a message and the share done.
    """

    def part(begin: float, end: float) -> Progress:
        return lambda message, share: progress(message, begin + (end - begin) * share)

    head, maps, _ = load(model, device)
    clip = refined(head, maps, clip, np.arange(len(clip)), part(0, POSES_SHARE))
    clip = find_covers(head, maps, clip, out, part(POSES_SHARE, COVERS_SHARE))
    write_poses(clip, out)
    progress("views of the film", COVERS_SHARE)
    views = None
    if isinstance(maps, ReferenceMaps):
        known = np.zeros(len(clip), bool)
        for name, seconds in learned:
            for first, stop in seconds if name == clip.clip.name else ():
                known[round(first * clip.rate) : round(stop * clip.rate)] = True
        views = views_of_film(head, maps, clip, known, out / PICTURES_FOLDER)
        shutil.rmtree(out / PICTURES_FOLDER, ignore_errors=True)
    saved_models.save_views(out / VIEWS_FILE, views)
