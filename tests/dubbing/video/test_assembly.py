"""The picture of a finished video: faces, marks, cards, and all the rest the film's own."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import RenderingError
from dubbing.preparation.prepared import OVERLAY, PreparedClip
from dubbing.preparation.tracking import cropping
from dubbing.provenance.card import CreditsCard, default_text
from dubbing.provenance.mark_key import marking
from dubbing.video import composer
from dubbing.video.assembly import make
from dubbing.video.film import read_frames
from dubbing.video.found_mark import found_before
from dubbing.video.heads import Face, Heads, read_heads
from dubbing.video.settings import VideoSettings
from tests import clips, fakes
from tests.dubbing.video.scene import Scene, kept_of, quiet, recording

pytestmark = pytest.mark.medium


def test_full_frame_outside_of_the_head_is_the_sources(scene: Scene) -> None:
    out = scene.make(np.arange(12), codec="ffv1", label=False)
    made = np.stack(list(media.read_frames(out)))
    source = np.stack(list(media.read_frames(scene.clip)))
    changed = (made != source).any(-1)
    assert not changed[3].any()  # no face in it: passed through
    rows, columns = np.flatnonzero(changed.any((0, 2))), np.flatnonzero(changed.any((0, 1)))
    # The window begins at (40, 20); the hole is 12..19 and the head 10..21, widened at most by 1.
    assert rows[0] >= 20 + 9
    assert rows[-1] <= 20 + 22
    assert columns[0] >= 40 + 9
    assert columns[-1] <= 40 + 22
    for k in (7, 11):  # far from the frame without a face
        assert tuple(made[k, 36, 56]) == (*fakes.HEAD[:2], k)


def test_poses_may_run_any_way(scene: Scene) -> None:
    poses = np.array([5, 6, 7, 6, 5, 4, 4, 4, 9, 1, 2])
    made = list(media.read_frames(scene.make(poses, codec="ffv1")))
    assert [clips.number(frame) for frame in made] == poses.tolist()
    # ... while the heads come in their own order.
    assert [int(frame[36, 56, 2]) for frame in made] == list(range(11))


def test_long_backward_runs_are_read_in_pieces(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:

    monkeypatch.setattr("dubbing.video.film.BACKWARDS", 3)
    clip = PreparedClip.load(scene.prepared)
    poses = np.array([11, 10, 9, 8, 7, 6, 5, 4, 3, 2])
    seen = []
    for film in read_frames(clip, poses):
        seen.append(clips.number(film.whole))
    assert seen == poses.tolist()


@pytest.mark.parametrize("codec", ["h264", "ffv1"])
@pytest.mark.parametrize(
    "pixels", ["yuv420p", "yuv420p10le", "yuv422p10le", "yuv444p12le", "bgr0", "gbrp16le"]
)
def test_every_value_that_is_not_replaced_is_the_films_own(
    tmp_path: Path, pixels: str, codec: str
) -> None:
    """Handed to the encoder of every codec; the lossless file shows it, with the mark."""
    scene = Scene(tmp_path, 12, pixels=pixels)
    (tmp_path / "own.key").write_bytes(b"a secret that nobody knows")
    clip, mark = PreparedClip.load(scene.prepared), marking(tmp_path / "own.key", "a dub")
    fakes.write_heads(scene.folder / "heads", 12, scene.rate)
    heads = [Heads(partial(read_heads, scene.folder / "heads"), clip, 0, 12, kept_of(clip))]
    plain, marked = (
        composer.Composer(heads, np.arange(12), VideoSettings(codec=codec, label=False, mark=m))
        for m in (None, mark)
    )
    films = list(media.read_planes(scene.clip))
    assert films[0][0].dtype == (np.uint8 if pixels in ("yuv420p", "bgr0") else np.uint16)
    changes, finished = 0, []
    for k, (own, (image, faces)) in enumerate(zip(films, plain.read(0, 12), strict=True)):
        assert image is not None
        _, replaced = composer.with_faces(image, faces, k)
        without, made = (c.frame(own, image, faces, k, k) for c in (plain, marked))
        for before, after in zip(own, made, strict=True):
            down, across = (-(-a // b) for a, b in zip(replaced.shape, before.shape, strict=True))
            kept = replaced.reshape(*before.shape[:1], down, -1, across).max((1, 3)) == 0
            np.testing.assert_array_equal(after[kept], before[kept])
        changes += any((a != b).any() for a, b in zip(made, without, strict=True))
        finished.append(made)
    assert changes == 11  # in frame 3 there is no face
    if codec == "ffv1":
        out = scene.make(np.arange(12), codec=codec, label=False, mark=mark)
        assert media.probe(out).pixels == media.probe(scene.clip).pixels
        for frame, made in zip(media.read_planes(out), finished, strict=True):
            for plane, wanted in zip(frame, made, strict=True):
                np.testing.assert_array_equal(plane, wanted)


def test_a_head_that_lies_in_a_square_film_is_replaced_where_it_lies(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = PreparedClip.load(scene.prepared)
    size = clip.size
    clip = replace(clip, crop=np.tile([0.0, 0.0, size, 1.0], (len(clip), 1)))
    picture = np.full((size, size, 3), 200, np.uint8)
    mask = np.zeros((size, size), np.uint8)
    mask[5:9] = 255
    monkeypatch.setattr(composer, "replacement", lambda *_: (picture, mask, mask))
    film = next(read_frames(PreparedClip.load(scene.prepared), np.array([0])))
    face = Face(clip, film, np.zeros(0), 1.0)
    shown, replaced = composer.with_faces(np.zeros((size, size, 3), np.uint8), [face], 0)
    assert np.array_equal(np.rot90(replaced), mask)
    assert np.array_equal(shown[..., 0] > 0, replaced > 0)


@pytest.mark.parametrize("frame", ["full", "crop"])
def test_only_what_is_new_gets_noise(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, frame: str
) -> None:
    """The film's own pixels, which a jaw takes along, have theirs."""
    clip = PreparedClip.load(scene.prepared)
    film = replace(next(read_frames(clip, np.array([5]))), noise=np.array([9.0, 9, 9, 0, 0]))
    picture = film.image // 2
    mask = np.full((clip.size, clip.size), 255, np.uint8)
    new = mask.copy()
    new[: clip.size // 2] = 0
    monkeypatch.setattr(composer, "replacement", lambda *_: (picture, mask, new))
    face = Face(clip, film, np.zeros(0), 1.0)
    image = film.whole if frame == "full" else film.image
    shown, replaced = composer.with_faces(image, [face], 5, crops=frame == "crop")
    if frame == "full":
        shown, replaced = (cropping.crop(x, clip.crop[5], clip.size) for x in (shown, replaced))
    away = np.abs(shown.astype(int) - picture).max(2)
    assert (replaced == 255).all()
    assert away[: clip.size // 2 - 1].max() <= 1
    assert np.median(away[clip.size // 2 + 1 :]) > 3


def test_what_became_of_the_faces_is_written_down(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "own.key").write_bytes(b"a secret that nobody knows")
    out = scene.make(np.arange(12), mark=marking(tmp_path / "own.key", "a dub"))
    picture = json.loads((out.parent / "picture.json").read_text())
    assert [(p["reason"], p["first"], p["stop"]) for p in picture["own_pixels"]] == [
        ("no face", 3, 4)
    ]
    assert picture["overlaid"] == []
    (reach,) = picture["reach"].values()
    assert (reach["frames"], reach["dubbed"], reach["reasons"]) == (12, 11, {"no face": 1})
    assert reach["yaw"]["most"] == 0
    assert not picture["mark"]["found"]  # a face of 10 px for half a second
    assert picture["mark"]["frames"] == 8  # the longest run with a face


def test_the_mark_is_looked_for_where_segments_were_made_again(tmp_path: Path) -> None:
    mark = {"first": 10, "found": True, "frames": 40}
    (tmp_path / "picture.json").write_text(json.dumps({"mark": mark}))
    rate = Fraction(25)

    def but(*made: int) -> np.ndarray:
        return ~np.isin(np.arange(100), made)

    # It read frames 10 to 50, and 3 after them.
    assert found_before(tmp_path, but(), 10, rate) == mark
    assert found_before(tmp_path, but(9, 53), 10, rate) == mark
    assert found_before(tmp_path, but(52), 10, rate) is None
    assert found_before(tmp_path, but()[:52], 10, rate) is None
    assert found_before(tmp_path, but(10), 10, rate) is None
    assert found_before(tmp_path, but(), 11, rate) is None
    assert found_before(None, but(), 10, rate) is None
    (tmp_path / "picture.json").write_text(json.dumps({"mark": {**mark, "found": False}}))
    assert found_before(tmp_path, but(), 10, rate) is None


def test_a_face_fades_with_its_shot_and_what_lies_over_it_is_listed(scene: Scene) -> None:
    clip = PreparedClip.load(scene.prepared)
    over, shown = np.zeros(12, bool), np.ones(12, np.float32)
    over[[3, 6, 7]], shown[9:] = True, (0.75, 0.5, 0.0)
    with media.VideoWriter(clip.folder / OVERLAY, 32, 32, clip.rate, "ffv1-gray") as writer:
        for _ in range(12):
            writer.write(np.full((32, 32), 255, np.uint8))
    replace(clip, over=over, shown=shown).save()
    out = scene.make(np.arange(12), codec="ffv1", label=False)
    picture = json.loads((out.parent / "picture.json").read_text())
    assert [(p["first"], p["stop"]) for p in picture["overlaid"]] == [(6, 8)]  # 3: no face
    made, source = (list(media.read_frames(path)) for path in (out, scene.clip))
    for k in (6, 7, 11):
        np.testing.assert_array_equal(made[k], source[k])
    for k, share in ((8, 1.0), (9, 0.75), (10, 0.5)):
        expected = source[k][36, 56] + share * (np.array([*fakes.HEAD[:2], k]) - source[k][36, 56])
        assert np.abs(made[k][36, 56] - expected).max() <= 2


def test_crop_writes_the_crop(scene: Scene) -> None:
    out = scene.make(np.arange(8), frame="crop", codec="ffv1", label=False)
    made = list(media.read_frames(out))
    source = list(media.read_frames(scene.clip, count=8))
    assert made[0].shape == (32, 32, 3)
    np.testing.assert_array_equal(made[0][:8], source[0][20:28, 40:72])
    np.testing.assert_array_equal(made[3], source[3][20:52, 40:72])
    assert tuple(made[7][16, 16]) == (*fakes.HEAD[:2], 7)


def test_the_label_is_on_every_frame(scene: Scene) -> None:
    marked = list(media.read_frames(scene.make(np.arange(6), "a", codec="ffv1")))
    plain = list(media.read_frames(scene.make(np.arange(6), "b", codec="ffv1", label=False)))
    for with_mark, without in zip(marked, plain, strict=True):
        assert (with_mark != without)[48:, 48:].any()
        np.testing.assert_array_equal(with_mark[:40], without[:40])


def test_too_few_heads_are_reported(scene: Scene) -> None:
    fakes.write_heads(scene.folder / "few", 7, scene.rate)
    with pytest.raises(RenderingError, match="7 heads instead of 12"):
        list(read_heads(scene.folder / "few", 0, 12))


def test_heads_are_read_across_files(scene: Scene) -> None:
    fakes.write_heads(scene.folder / "heads", 12, scene.rate)
    got = [int(head[16, 16, 2]) for head in read_heads(scene.folder / "heads", 3, 8)]
    assert got == list(range(3, 11))


def test_two_faces_in_one_frame_each_while_it_speaks(scene: Scene) -> None:
    """One on the right of the film in frames 2 to 8, one on the left in frames 6 to 11."""
    film, folder = PreparedClip.load(scene.prepared), scene.folder
    other = fakes.write_prepared(scene.clip, folder / "other", window=(4, 20, 32))
    for name, count in (("a", 6), ("b", 5)):
        fakes.write_heads(folder / name, count, scene.rate)
    heads = [
        Heads(partial(read_heads, folder / "a"), film, 2, 8, kept_of(film)),
        Heads(partial(read_heads, folder / "b"), other, 6, 11, kept_of(other)),
    ]
    out = make(
        heads,
        recording(scene.audio, 0.0, 12 / 25, 12),
        folder / "out",
        pose_index=np.arange(12),
        settings=VideoSettings(codec="ffv1", label=False),
        progress=quiet,
    )
    made = np.stack(list(media.read_frames(out)))
    source = np.stack(list(media.read_frames(scene.clip)))
    changed = (made != source).any(-1)
    right, left = changed[:, :, 40:].any((1, 2)), changed[:, :, :40].any((1, 2))
    assert np.flatnonzero(right).tolist() == [2, 4, 5, 6, 7]  # frame 3 shows no face there
    assert np.flatnonzero(left).tolist() == [6, 7, 8, 9, 10]
    assert tuple(made[8, 36, 20]) != tuple(source[8, 36, 20])


@pytest.mark.parametrize("codec", ["h264", "ffv1"])
def test_a_card_follows_in_silence(scene: Scene, codec: str) -> None:
    card = CreditsCard(default_text(["Ann"]), 30)
    plain = scene.make(np.arange(12), "plain", codec=codec)
    made = scene.make(np.arange(12), "card", codec=codec, card=card)
    assert media.count_frames(made) == 12 + 30
    pictures = np.stack(list(media.read_frames(made)))
    np.testing.assert_array_equal(pictures[:12], np.stack(list(media.read_frames(plain))))
    shown = pictures[12:].astype(int)
    assert np.ptp(shown, axis=0).max() < 8  # it stands still
    assert np.ptp(shown[0]) > 100
    assert media.probe(made).sound_seconds == pytest.approx(42 / 25, abs=0.05)
    heard, own = (media.read_audio(path, rate=48000) for path in (made, plain))
    samples = 12 * 1920
    np.testing.assert_allclose(heard[: samples - 2048], own[: samples - 2048], atol=0.02)
    assert np.abs(heard[samples + 2048 :]).max() < 1e-3 < np.abs(heard[:samples]).max()


def test_the_invisible_mark_lies_on_faces_alone(scene: Scene, tmp_path: Path) -> None:
    key = tmp_path / "own.key"
    key.write_bytes(b"sixteen bytes and more")
    settings = {"codec": "ffv1", "label": False}
    plain = list(media.read_frames(scene.make(np.arange(12), "plain", **settings)))
    mark = marking(key, ["what it was made of"])
    made = list(media.read_frames(scene.make(np.arange(12), "made", mark=mark, **settings)))
    for k, (one, other) in enumerate(zip(made, plain, strict=True)):
        assert (one != other).any() == (k != 3)  # no face in it
        assert np.abs(one.astype(int) - other).max() < 16
    cropped = scene.make(np.arange(6), "crop", mark=mark, frame="crop", **settings)
    assert next(iter(media.read_frames(cropped))).shape == (32, 32, 3)
