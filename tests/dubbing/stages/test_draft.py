"""Drafted heads and lips of a small model: what an edit does to them."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from dfrf import presets
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.face.mouth.lip_curves import text_of
from dubbing.identity.lip_scale import LipScale
from dubbing.preparation.halved import HalvedClip
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from dubbing.sound_to_lips.cue_speech import Speech
from dubbing.stages.draft import HalfSize
from tests import clips, fakes
from tests.dfrf.people import small_config

pytestmark = pytest.mark.medium
COUNT = 9
ROUNDED = 4  # grey levels, of four digits in a table and of bfloat16
CUE = Cue("ann", 0, COUNT, Path("it.wav"), 0.0, COUNT / 25)
SCALE = LipScale(np.full(7, 1.0), np.full(7, 0.01))


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> HalfSize:
    folder = tmp_path_factory.mktemp("draft")
    film = clips.write_clip(folder / "film.mp4", COUNT)
    clip = HalvedClip.of(fakes.write_prepared(film, folder / "prepared", size=64))
    random, steps = np.random.default_rng(0), 2 * COUNT
    features = random.random((steps, 8)).astype(np.float32) + 0.1
    lips = random.random((steps, NUMBERS)).astype(np.float32)
    voice = np.ones(steps, np.float32)
    speech = Speech("mel", COUNT, Fraction(25), COUNT / 25, features, voice, lips)
    found = HalfSize(
        {"ann": clip},
        {"ann": np.zeros(COUNT, int)},
        np.arange(COUNT),
        {CUE.name: speech},
        {},
        "cpu",
    )
    torch.manual_seed(1)
    model = presets.build(small_config(references=0, use_warp=False)).eval()
    vars(found).update(models={"ann": (model, None)}, scales={"ann": SCALE})
    return found


def test_a_draft_of_a_close_up_has_small_heads_in_their_places(tmp_path: Path) -> None:
    film = clips.write_clip(tmp_path / "film.mp4", 1)
    full = fakes.write_prepared(film, tmp_path / "prepared", size=640)
    clip = HalvedClip.of(full)
    (frame,) = clip.film_frames()
    assert frame.image.shape == frame.background.shape == (256, 256, 3)
    in_film, in_half = (
        (one.landmarks[0] + 0.5) * (one.crop[0, 2] / one.size) + one.crop[0, :2]
        for one in (full, clip)
    )
    assert np.abs(in_half - in_film / 2).max() < 1e-3


def drawn(half: HalfSize, **edit: Any) -> np.ndarray:
    return np.stack(list(half.heads(CUE, Edit(**edit)).read(0, COUNT))).astype(int)


def test_an_edit_changes_its_own_frames_alone(half: HalfSize, tmp_path: Path) -> None:
    heard = half.lips(CUE, Edit(shift=80, strength=0))  # both count for nothing
    assert heard is not None
    assert heard.shape == (COUNT, 7)
    times = Edit().heard(COUNT, Fraction(25))
    whole = drawn(half)
    assert whole[..., 3].max() > 200
    table = tmp_path / "heard.csv"
    written = half.curves(CUE, Edit())
    assert written is not None
    table.write_text(text_of((1, k, times[k], written[k]) for k in range(COUNT)))
    again = half.lips(CUE, Edit(curves=(table, 1)))
    assert again is not None
    np.testing.assert_allclose(again, heard, atol=1e-3)
    assert np.abs(drawn(half, curves=(table, 1)) - whole).max() <= ROUNDED
    written[:, :-1] += 0.05
    table.write_text(text_of((1, k, times[k], written[k]) for k in range(4, 6)))
    changed = np.abs(drawn(half, curves=(table, 1)) - whole).max((1, 2, 3)) > ROUNDED
    assert np.flatnonzero(changed).tolist() == [4, 5]
    apart = np.abs(drawn(half, keys=((0.22, 0.0),)) - whole).max((1, 2, 3)) > ROUNDED
    assert np.flatnonzero(apart).tolist() == [3, 4, 5, 6, 7]


def test_a_moved_part_is_seen_as_a_shifted_line_is(half: HalfSize) -> None:
    """The last frame's speech does not reach back to the first one, which is not in step yet."""
    plain, shifted, moved = (
        drawn(half, **edit)[-1]
        for edit in ({}, {"shift": 40}, {"moved": ((0.0, COUNT / 25, 40.0),)})
    )
    assert np.abs(moved - shifted).max() <= ROUNDED
    assert np.abs(moved - plain).max() > ROUNDED


def test_a_style_is_seen(half: HalfSize) -> None:
    plain, softer = (drawn(half, style=style) for style in ("as spoken", "softer"))
    assert np.abs(softer - plain).max() > ROUNDED
    soft, heard = (half.lips(CUE, Edit(style=style)) for style in ("softer", "as spoken"))
    assert soft is not None
    assert heard is not None
    assert np.abs(np.diff(soft, axis=0)).mean() < 0.7 * np.abs(np.diff(heard, axis=0)).mean()
