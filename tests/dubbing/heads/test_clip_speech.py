"""Speech of a person at each frame of their own clip, with its sound early or late."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.heads import fine_tuning
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
    return SimpleNamespace(
        clip=film, frames_count=FRAMES, part=(0, FRAMES), rate=media.probe(film).rate
    )


def test_of_a_part_the_sound_round_it_is_heard(clip: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fine_tuning, "SOUND_BESIDE", 0.4)
    chance = np.random.default_rng(0)
    bursts = np.repeat(chance.uniform(0, 0.5, FRAMES), 640) * chance.normal(0, 0.3, 32000)
    soundfile.write(clip.clip.with_name("a.wav"), bursts, 16000)
    sound, silent = clip.clip.with_name("a.wav"), clip.clip.with_name("silent.mp4")
    media.mux(silent, sound, clip.clip, audio_start=0, seconds=FRAMES / 25)
    whole = clip_speech(clip, "mel")
    short: Any = SimpleNamespace(**vars(clip) | {"part": (20, 40)})
    part = clip_speech(short, "mel")
    assert len(part) == FRAMES

    def apart(late: int) -> float:
        """Spread of the difference: the features count from the loudness of what is heard."""
        return float((part.windows[20:40] - whole.windows[20 + late : 40 + late]).std())

    assert min(range(-3, 4), key=apart) == 0
    assert apart(0) < 0.5 * min(apart(-1), apart(1))


def test_sound_that_comes_early_is_heard_so_many_frames_before(clip: Any) -> None:
    plain, early, late = (clip_speech(clip, "mel", offset=k) for k in (0, EARLY, -EARLY))
    np.testing.assert_allclose(early.windows[EARLY:], plain.windows[:-EARLY], atol=1e-5)
    np.testing.assert_allclose(early.lips[EARLY:], plain.lips[:-EARLY], atol=1e-5)
    np.testing.assert_allclose(late.windows[:-EARLY], plain.windows[EARLY:], atol=1e-5)
    assert np.abs(early.windows - plain.windows).max() > 0.1
