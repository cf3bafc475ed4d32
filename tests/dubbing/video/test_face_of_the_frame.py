"""A dub replaces the face where it is in that very frame, not where it was in the one before."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.compositing.face_mask import rendered_region
from dubbing.heads.rendering import regions_of
from dubbing.mixing.sound import Sound
from dubbing.preparation.prepared import PreparedClip
from dubbing.script.timeline import Cue
from dubbing.video.assembly import make
from dubbing.video.heads import Heads, read_heads
from dubbing.video.settings import VideoSettings
from tests import clips, fakes

pytestmark = pytest.mark.medium


FRAMES, SIZE, WINDOW = 8, (96, 64), (40, 20, 32)
SIDES = np.array([1, -1, 1, 1, -1, -1, 1, -1])  # right and left in the picture


def moving(folder: Path) -> PreparedClip:
    """A clip whose face jumps to and fro."""
    film = clips.write_clip(folder / "film.mkv", FRAMES, size=SIZE, pixels="bgr0")
    clip = fakes.write_prepared(film, folder, window=WINDOW, invalid=(2,))
    moved = clip.landmarks + 7.0 * np.stack([SIDES, 0 * SIDES], 1)[:, None]
    clip = replace(clip, landmarks=moved)
    clip.save()
    return clip


def test_what_is_rendered_goes_with_the_face(tmp_path: Path) -> None:
    clip, poses = moving(tmp_path), np.array([1, 0, 2, 6])
    regions = regions_of(clip, poses)
    assert not regions[2].any()  # no face is seen
    expected = [rendered_region(clip.landmarks[pose], clip.size) for pose in (1, 0, 6)]
    assert (expected[0] != expected[1]).any()
    np.testing.assert_array_equal(regions[[0, 1, 3]], expected)


@pytest.mark.parametrize("poses", [list(range(FRAMES)), [3, 4, 5, 6, 7, 6, 5, 4]])
@pytest.mark.parametrize("frame", ["full", "crop"])
def test_what_is_replaced_goes_with_the_face(tmp_path: Path, poses: list[int], frame: str) -> None:
    clip = moving(tmp_path)
    fakes.write_heads(tmp_path / "heads", len(poses), clip.rate)
    sound = clips.write_sound(tmp_path / "it.wav", 1.0)
    out = make(
        [
            Heads(
                partial(read_heads, tmp_path / "heads"), clip, 0, len(poses), np.zeros(FRAMES, int)
            )
        ],
        Sound((Cue("ann", 0, len(poses), sound, 0.0, len(poses) / 25),)),
        tmp_path / "out",
        pose_index=np.array(poses),
        settings=VideoSettings(frame=frame, label=False, codec="ffv1"),
        progress=lambda _message, _share: None,
    )
    whole = list(media.read_frames(clip.clip))
    left, top, side = WINDOW
    for dub, pose in zip(media.read_frames(out), poses, strict=True):
        crop = whole[pose][top : top + side, left : left + side]
        shown = dub[top : top + side, left : left + side] if frame == "full" else dub
        replaced = np.flatnonzero((shown != crop).any((0, 2)))
        assert np.sign(replaced.mean() - (side - 1) / 2) == SIDES[pose]
