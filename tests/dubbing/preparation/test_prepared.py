"""A prepared clip on disk and in memory."""

from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import PreparationError
from dubbing.media import VideoWriter, read_frames
from dubbing.preparation.alignment.camera import rotation_from_vector
from dubbing.preparation.matting.matting import inpaint_mask
from dubbing.preparation.prepared import (
    ARRAYS,
    BACKGROUND,
    MATTE,
    OVERLAY,
    VERSION,
    PreparedClip,
)

FRAMES, SIZE = 6, 64


@pytest.fixture
def prepared(tmp_path: Path) -> PreparedClip:
    rng = np.random.default_rng(0)
    rate = Fraction(30000, 1001)
    clip = tmp_path / "clip.mkv"
    with VideoWriter(clip, 96, 80, rate, "ffv1") as writer:
        for _ in range(FRAMES):
            writer.write(rng.integers(0, 255, (80, 96, 3), np.uint8))
    matte = np.zeros((SIZE, SIZE), np.uint8)
    matte[20:40, 20:40] = 255
    with VideoWriter(tmp_path / MATTE, SIZE, SIZE, rate, "ffv1-gray") as writer:
        for _ in range(FRAMES):
            writer.write(matte)
    with VideoWriter(tmp_path / BACKGROUND, SIZE, SIZE, rate, "ffv1") as writer:
        for k in range(FRAMES):
            writer.write(np.full((SIZE, SIZE, 3), 10 * k, np.uint8))
    with VideoWriter(tmp_path / OVERLAY, SIZE, SIZE, rate, "ffv1-gray") as writer:
        for k in range(FRAMES):
            writer.write(np.full((SIZE, SIZE), 40 * k, np.uint8))
    return PreparedClip(
        folder=tmp_path,
        clip=clip,
        rate=rate,
        frames_count=FRAMES,
        part=(0, FRAMES),
        size=SIZE,
        source_size=(96, 80),
        focal=150.0,
        near=6.0,
        far=10.0,
        warnings=["a cut"],
        face_warnings=[],
        residual_shift=0.07,
        rotation=rotation_from_vector(rng.normal(0, 0.2, (FRAMES, 3))),
        translation=rng.normal(0, 0.1, (FRAMES, 3)) + np.array([0, 0, 8]),
        centre=np.full((FRAMES, 2), 31.5),
        crop=np.tile([12.0, 5.0, 64.0, 0.0], (FRAMES, 1)),
        valid=np.ones(FRAMES, bool),
        detected=np.ones(FRAMES, bool),
        covered=np.zeros(FRAMES, bool),
        over=np.arange(FRAMES) == 1,
        shown=np.ones(FRAMES, np.float32),
        haze=np.zeros((FRAMES, 3)),
        noise=np.zeros((FRAMES, 5)),
        segment=np.zeros(FRAMES, int),
        landmarks=rng.uniform(0, SIZE, (FRAMES, 478, 2)).astype(np.float32),
        lip_shift=rng.uniform(0, SIZE, (FRAMES, 40, 2)).astype(np.float32),
        shape=rng.normal(size=(478, 3)),
    )


def test_saved_and_loaded_is_the_same(prepared: PreparedClip) -> None:
    prepared.save()
    loaded = PreparedClip.load(prepared.folder)
    for field in fields(PreparedClip):
        mine, theirs = getattr(prepared, field.name), getattr(loaded, field.name)
        if isinstance(mine, np.ndarray):
            assert mine.dtype == theirs.dtype
            assert np.array_equal(mine, theirs), field.name
        else:
            assert mine == theirs, field.name
    assert len(loaded) == FRAMES


def test_a_folder_that_is_not_prepared_is_reported(tmp_path: Path, prepared: PreparedClip) -> None:
    with pytest.raises(PreparationError, match="dfrf prepare"):
        PreparedClip.load(tmp_path / "nothing")
    prepared.save()
    summary = prepared.folder / "prepared.json"
    summary.write_text(summary.read_text().replace(f'"version": {VERSION}', '"version": 0'))
    with pytest.raises(PreparationError, match="version 0"):
        PreparedClip.load(prepared.folder)


def test_frames_stream_from_anywhere_and_keep_the_picture_outside_the_hole(
    prepared: PreparedClip,
) -> None:
    source = list(read_frames(prepared.clip))
    for start, count in ((0, None), (3, 2)):
        read = list(prepared.frames(start, count))
        assert len(read) == (count or FRAMES)
        for k, (image, matte, background) in enumerate(read, start):
            assert np.array_equal(image, source[k][5:69, 12:76])
            inside = inpaint_mask(matte)
            assert inside.any()
            assert not inside.all()
            assert np.array_equal(background[~inside], image[~inside])
            assert (background[inside] == 10 * k).all()


def test_a_part_is_read_where_it_lies_in_the_clip(prepared: PreparedClip) -> None:
    """Its files hold its frames alone; beside it the clip shows no face."""
    whole = list(read_frames(prepared.clip))
    part = replace(prepared, frames_count=FRAMES - 3, part=(0, FRAMES - 3))
    arrays = {name: getattr(part, name)[: FRAMES - 3] for name in ARRAYS if name != "shape"}
    replace(part, **arrays).within(2, FRAMES).save()
    loaded = PreparedClip.load(prepared.folder)
    assert len(loaded) == FRAMES
    assert loaded.part == (2, FRAMES - 1)
    assert loaded.valid.tolist() == [False] * 2 + [True] * (FRAMES - 3) + [False]
    assert loaded.segment.tolist() == [0] * 2 + [1] * (FRAMES - 3) + [2]
    for start, count in ((0, None), (1, 2), (FRAMES - 2, 2), (FRAMES - 1, 1)):
        read = list(loaded.film_frames(start, count))
        assert len(read) == (count or FRAMES)
        for k, frame in enumerate(read, start):
            assert np.array_equal(frame.whole, whole[k])
            inside = 2 <= k < FRAMES - 1
            assert frame.matte.any() == inside
            assert (frame.fill == (10 * (k - 2) if inside else 0)).all()
            assert (frame.overlay is not None) == (k == 3)


def test_an_overlay_is_read_where_something_lies_over_the_face(prepared: PreparedClip) -> None:
    for start in (0, 1):
        overlays = [frame.overlay for frame in prepared.film_frames(start)]
        seen = [k for k, overlay in enumerate(overlays, start) if overlay is not None]
        assert seen == [1]
        over = overlays[1 - start]
        assert over is not None
        assert (over == 40).all()
    assert next(prepared.film_frames(2)).overlay is None


def test_camera_to_world_sees_the_points_where_the_pose_does(prepared: PreparedClip) -> None:
    points = np.random.default_rng(1).normal(0, 0.5, (20, 3))
    flip = np.diag([1.0, -1, -1])
    for k, pose in enumerate(prepared.c2w()):
        in_camera = points @ prepared.rotation[k].T + prepared.translation[k]
        # The same points in the world's axes, through the inverse of the OpenGL camera.
        seen = (points @ flip - pose[:, 3]) @ pose[:, :3]
        np.testing.assert_allclose(seen, in_camera @ flip, atol=1e-12)
        assert np.linalg.det(pose[:, :3]) == pytest.approx(1)


def test_pasting_a_crop_back_gives_the_frame(prepared: PreparedClip) -> None:
    frame = next(read_frames(prepared.clip))
    image, matte, _ = next(prepared.frames(0, 1))
    assert np.array_equal(prepared.paste(frame, 0, image, matte)[0], frame)
    changed, laid = prepared.paste(frame, 0, 255 - image, matte)
    outside = np.ones(frame.shape[:2], bool)
    outside[5 + 20 : 5 + 40, 12 + 20 : 12 + 40] = False
    assert np.array_equal(changed[outside], frame[outside])
    assert np.array_equal(laid == 0, outside)


def test_landmarks_seen_from_the_front(prepared: PreparedClip) -> None:
    """Whichever way the head is turned, a face at rest has the same frontal landmarks."""
    shape = np.random.default_rng(1).normal(0, 0.4, (478, 3))
    in_camera = shape @ prepared.rotation.transpose(0, 2, 1) + prepared.translation[:, None]
    seen = prepared.focal * in_camera[..., :2] / in_camera[..., 2:] + prepared.centre[:, None]
    turned = replace(prepared, shape=shape, landmarks=seen)
    expected = np.tile(shape[:, :2], (len(prepared), 1, 1))
    np.testing.assert_allclose(turned.frontal_landmarks(), expected, atol=1e-9)
