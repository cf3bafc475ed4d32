"""Every stage that the benchmark times runs, on a person of a few pixels."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.media import VideoWriter
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.workshop.bench.timing import Scene, dub_row, frame_rows
from tests.dfrf.people import FOCAL, SIZE, random_model
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


COUNT = 12
STAGES = (
    "speech code",
    "project the grid",
    "march",
    "field, every sample",
    "head, what is seen",
    "head, what a dub shows",
    "baked head, what a dub shows",
    "a step of a pose",
    "composite",
)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """A model that has learned nothing, before a grey clip."""
    model, maps = random_model()
    with VideoWriter(tmp_path / "clip.mkv", SIZE, SIZE, Fraction(25), "ffv1") as video:
        for _ in range(COUNT):
            video.write(np.full((SIZE, SIZE, 3), 90, np.uint8))
    clip = write_prepared(tmp_path / "clip.mkv", tmp_path, size=SIZE)
    landmarks = clip.landmarks + np.random.default_rng(0).normal(0, 4, clip.landmarks.shape)
    clip = replace(clip, focal=FOCAL, landmarks=landmarks)
    windows = np.random.default_rng(1).normal(size=(COUNT, 16, 8))
    speech = SpeechFrames(windows, np.zeros((len(windows), NUMBERS), np.float32))
    return Scene(model, maps, clip, speech, [3, 6])


def test_every_stage_of_a_frame_runs_and_is_timed(scene: Scene) -> None:
    rows = frame_rows(scene)
    assert tuple(row.stage for row in rows) == STAGES
    assert all(row.seconds > 0 for row in rows)
    assert dub_row(replace(scene, frames=[COUNT - 1])).seconds > 0
