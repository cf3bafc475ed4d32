"""Sound that is gone through several times."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import media
from dubbing.media.reading import sound_blocks
from tests import clips


@pytest.mark.parametrize(("seconds", "times"), [(1.5, 1), (2.5, 2), (None, 2)])
def test_short_sound_is_decoded_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seconds: float | None, times: int
) -> None:
    path = clips.write_sound(tmp_path / "it.wav", 3.0)
    decoded = []

    def counted(*of: Any, **how: Any) -> Iterator[np.ndarray]:
        decoded.append(of)
        return media.iter_audio(*of, **how)

    monkeypatch.setattr(sound_blocks, "KEPT_S", 2.0)
    monkeypatch.setattr(sound_blocks, "iter_audio", counted)
    blocks = media.sound_blocks(path, start=0.4, seconds=seconds)
    first, again = (np.concatenate(list(blocks())) for _ in range(2))
    assert len(decoded) == times
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, media.read_audio(path, start=0.4, seconds=seconds))
    assert len(first) == round(16000 * (seconds or 2.6))
