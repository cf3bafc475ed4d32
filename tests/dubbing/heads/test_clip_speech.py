"""Speech of a person at each frame of their own clip, with its sound early or late."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.heads.fine_tuning import clip_speech
from tests import clips

pytestmark = pytest.mark.medium


FRAMES, EARLY = 50, 3


@pytest.fixture
def clip(tmp_path: Path) -> Any:
    """Two seconds with sound that says when it is heard: it grows louder."""
    silent = clips.write_video(tmp_path / "silent.mp4", FRAMES)
    time = np.arange(2 * 16000) / 16000
    soundfile.write(tmp_path / "a.wav", 0.4 * time / 2 * np.sin(2 * np.pi * 300 * time), 16000)
    film = tmp_path / "film.mp4"
    media.mux(silent, tmp_path / "a.wav", film, audio_start=0, seconds=FRAMES / 25)
    return SimpleNamespace(clip=film, frames_count=FRAMES, rate=media.probe(film).rate)


def test_sound_that_comes_early_is_heard_so_many_frames_before(clip: Any) -> None:
    plain, early, late = (clip_speech(clip, "mel", offset=k) for k in (0, EARLY, -EARLY))
    np.testing.assert_allclose(early.windows[EARLY:], plain.windows[:-EARLY], atol=1e-5)
    np.testing.assert_allclose(early.lips[EARLY:], plain.lips[:-EARLY], atol=1e-5)
    np.testing.assert_allclose(late.windows[:-EARLY], plain.windows[EARLY:], atol=1e-5)
    assert np.abs(early.windows - plain.windows).max() > 0.1
