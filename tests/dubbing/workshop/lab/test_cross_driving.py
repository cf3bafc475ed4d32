"""A dub of held-out speech: which frames, through which compositor, and what is said of it."""

from __future__ import annotations

import csv
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch

from dfrf import presets, saved_models
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.heads import rendering as heads
from dubbing.media import read_frames
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.video import composer
from dubbing.workshop.lab import cross_driving, tiles
from dubbing.workshop.lab.cross_driving import frames_under, measure_dub
from tests import clips
from tests.dfrf.people import small_config
from tests.dubbing.sync.meshes import talk
from tests.dubbing.workshop.lab.faces import show_faces
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


FRAMES, LEARNED = 12, [(2, 5)]
PARTS = [(7, 5), (0, 2)]
RATE = Fraction(25)


def test_pictures_are_learned_frames_of_one_shot_with_a_face_there_and_back() -> None:
    valid, segment = np.ones(20, bool), np.zeros(20, int)
    segment[9:] = 1
    valid[12] = False
    # Learned 4 .. 14: the shot to 8 is five frames long, 9 to 11 three, 13 and 14 two.
    found = frames_under(valid, segment, [(4, 11)], 12)
    assert found.tolist() == [4, 5, 6, 7, 8, 7, 6, 5, 4, 5, 6, 7]
    assert frames_under(valid, segment, [(12, 2)], 3).tolist() == [13, 13, 13]
    assert frames_under(valid, segment, [(0, 2), (4, 3)], 4).tolist() == [4, 5, 6, 5]


@pytest.fixture
def person(tmp_path: Path) -> Path:
    """A folder with a prepared clip, and a tiny model that was never trained."""
    clips.write_video(tmp_path / "clip.mkv", FRAMES, codec="ffv1")
    (tmp_path / "prepared").mkdir()
    clip = write_prepared(tmp_path / "clip.mkv", tmp_path / "prepared")
    random = np.random.default_rng(0)
    shape = np.concatenate([random.uniform(-0.8, 0.8, (478, 2)), np.zeros((478, 1))], 1)
    replace(clip, shape=shape).save()
    torch.manual_seed(0)  # whichever tests ran before: noise can look like a face
    model = presets.build(small_config(references=0, use_warp=False))
    saved_models.save_person(tmp_path / "model.safetensors", model, None, {})
    return tmp_path


def measured(folder: Path) -> tuple[dict[str, float], list[dict[str, str]]]:
    windows = np.random.default_rng(1).random((FRAMES, 16, 8)).astype(np.float32)
    speech = SpeechFrames(windows, np.zeros((len(windows), NUMBERS), np.float32))
    figures = measure_dub(
        *(folder / "model.safetensors", PreparedClip.load(folder / "prepared"), speech),
        *(PARTS, LEARNED, folder / "out"),
        device="cpu",
        progress=lambda message, share: None,
    )
    with (folder / "out" / "frames.csv").open() as file:
        return figures, list(csv.DictReader(file))


def test_the_lips_of_a_dub_are_compared_with_those_of_its_speech(
    person: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gaps = np.array([0.0, 0.1, 0.2, 0.05, 0.0, 0.15, 0.1])
    show_faces(monkeypatch, cross_driving, [talk(gaps / 2), talk(gaps)], scale=16)
    figures, rows = measured(person)
    assert [int(row["frame"]) for row in rows] == [7, 8, 9, 10, 11, 0, 1]
    assert [int(row["under"]) for row in rows] == [2, 3, 4, 5, 6, 5, 4]
    assert figures["frames"] == 7
    assert figures["opening_r"] == pytest.approx(1)
    assert figures["opening_ratio"] == pytest.approx(0.5, rel=0.01)
    assert figures["closure_f1"] == 1
    assert figures["lmd"] > 0
    assert figures["chin_ratio"] > 0
    assert (person / "out" / tiles.TILES_FILE).is_file()
    # The first part alone has a sound of its own.
    for kind in ("render", "source"):
        assert len(list(read_frames(person / "out" / f"{kind}_picture.mp4"))) == 5


def test_a_dub_without_a_face_says_so(person: Path) -> None:
    figures, rows = measured(person)
    assert len(rows) == 7
    assert figures == {"frames": 7}  # the source has none either


def test_frames_go_through_the_compositor_of_a_dub(
    person: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are what the video stage makes of the same heads over the same frames."""
    clip = PreparedClip.load(person / "prepared")
    # The face goes to and fro: what is replaced tells the frame that it was found in.
    place = 5.0 * (-1.0) ** np.arange(FRAMES)[:, None] * (1, 0)
    clip = replace(clip, landmarks=clip.landmarks + place[:, None])
    asked: list[int] = []

    def frames(*arguments: object, baked: bool) -> list[int]:
        assert baked  # as in a dub
        first, stop = arguments[-2:]
        assert isinstance(first, int)
        assert isinstance(stop, int)
        return [(k, 0) for k in range(first, stop)]  # type: ignore[misc]

    def to_rgba(k: int, _: int) -> np.ndarray:
        asked.append(k)
        head = np.zeros((clip.size, clip.size, 4), np.uint8)
        head[10:22, 10:22] = (200, 10 * k, 90, 255)
        return head

    monkeypatch.setattr(heads, "frames", frames)
    monkeypatch.setattr(heads, "to_rgba", to_rgba)
    monkeypatch.setattr(cross_driving, "AT_ONCE", 2)
    under = np.array([4, 5, 6, 5, 4, 3, 2])
    windows = np.zeros((FRAMES, 16, 8), np.float32)
    speech = SpeechFrames(windows, np.zeros((len(windows), NUMBERS), np.float32))
    found = list(
        cross_driving.dubbed(
            *(person / "model.safetensors", clip, speech, PARTS, under, "cpu"),
            lambda message, share: None,
        )
    )
    assert asked == [7, 8, 9, 10, 11, 0, 1]
    assert [index for _, _, index in found] == under.tolist()
    for k, (dub, film, index) in zip([7, 8, 9, 10, 11, 0, 1], found, strict=True):
        (frame,) = composer.read_frames(clip, np.array([index]))
        face = composer.Face(clip, frame, to_rgba(k, 0), 1.0)
        whole, _ = composer.with_faces(frame.whole, [face], index)
        x0, y0, side, _ = (int(v) for v in clip.crop[index])
        assert np.array_equal(dub, whole[y0 : y0 + side, x0 : x0 + side])
        assert np.array_equal(film, frame.image)
        assert not np.array_equal(dub, film)
