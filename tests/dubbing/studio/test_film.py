"""What is measured in drafted frames."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dubbing.face.mouth.lip_measures import lip_lengths
from dubbing.preparation.halved import HalvedClip
from dubbing.preparation.prepare import prepare
from dubbing.studio.film import Film, as_jpeg, of_jpeg
from dubbing.workshop.synthetic.speaker import make_speaker

pytestmark = pytest.mark.medium
SIZE = 256


def test_lips_are_measured_as_the_film_s_were(tmp_path: Path) -> None:
    make_speaker(tmp_path, text="My mama.", seconds=0.6, size=SIZE)
    clip = HalvedClip.of(prepare(tmp_path / "clip.mp4", tmp_path / "prepared", size=SIZE))
    frames = len(clip)
    film: Any = object.__new__(Film)
    cue = SimpleNamespace(identity="ann", first=1, stop=frames)
    film.stage = SimpleNamespace(sound=SimpleNamespace(cues=(cue,)))
    film.half = SimpleNamespace(clips={"ann": clip}, poses=np.arange(frames))
    images = [of_jpeg(as_jpeg(image)) for image in clip.whole_frames()]
    assert film.measured(0, images[0]) == {}  # beside the line
    assert film.measured(1, np.zeros_like(images[1])) == {}
    measured = [film.measured(k, images[k]) for k in range(1, frames)]
    true = lip_lengths(clip.frontal_landmarks())[1:]
    assert np.ptp(true[:, 0]) > 0.05
    for column, name in ((0, "opening"), (3, "width")):
        own = np.array([one[name] for one in measured])
        assert np.abs(own - true[:, column]).mean() < 0.02, name
