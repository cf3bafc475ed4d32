"""The steps of a preparation: results of finished steps are read, the others are computed."""

import shutil
import zipfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dubbing.engine.disk import json_records
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import atomic_path, atomic_write_json, note_checksum
from dubbing.engine.graph.stage import Progress, ReportShare
from dubbing.errors import PreparationError
from dubbing.preparation.file_names import SUMMARY
from dubbing.preparation.prepared import VERSION
from dubbing.preparation.tracking.detection import Arrays

STEPS, LAYOUT = "steps", 8  # the folder of the steps, and the version of its files
# Shares of the steps in the time of a preparation, 13 s at 512 px.
TIMES = {
    "faces": 0.04,
    "landmarks": 0.36,
    "poses": 0.01,
    "occlusion": 0.04,
    "overlay": 0.06,
    "refinement": 0.15,
    "turned": 0.01,
    "lips": 0.01,
    "matte": 0.07,
    "background": 0.25,
}


class Steps:
    """Steps whose arrays lie in a folder, each in a file that is written atomically.

    Steps of another clip, of another version or with other settings are deleted.
    """

    def __init__(
        self, folder: Path, clip: Path, settings: Mapping[str, Any], progress: Progress
    ) -> None:
        self.folder, self._clip, self._report = folder, clip, progress
        key = {"clip": digest_of(clip), **settings, "version": VERSION, "layout": LAYOUT}
        key_file = folder / "key.json"
        if json_records.read_or(None, key_file, dict[str, Any]) != key:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            (folder.parent / SUMMARY).unlink(missing_ok=True)
            atomic_write_json(key_file, key)

    def run(self, name: str, step: Callable[[ReportShare], Arrays], *beside: Path) -> Arrays:
        """The arrays of a step: read if it was finished, else computed and written.

        Args:
            beside: other files that it writes.

        Raises:
            PreparationError: the detected face is not a face, so no head fits it.
        """
        path = self.folder / f"{name}.npz"
        arrays = _stored(path) if all(file.is_file() for file in beside) else None
        if arrays is None:
            try:
                arrays = step(partial(self._progress, name))
            except np.linalg.LinAlgError as error:  # something that only looked like a face
                raise PreparationError(
                    f"what looks like a face is none that can be tracked ({name}: {error})",
                    str(self._clip),
                    "use a clip in which one person faces the camera",
                ) from error
            for file in beside:
                note_checksum(file)
            with atomic_path(path) as temporary:
                np.savez(temporary, allow_pickle=False, **arrays)
        self._progress(name, 1.0)
        return arrays

    def _progress(self, name: str, share: float) -> None:
        """Report the share of all steps that is done, from the share of one step."""
        steps = [*TIMES]
        before = sum(TIMES[step] for step in steps[: steps.index(name)])
        self._report(name, min(1.0, before + TIMES[name] * share))


def _stored(path: Path) -> Arrays | None:
    """The arrays of a finished step; None where they are missing or their checksums are wrong."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {key: stored[key] for key in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None
