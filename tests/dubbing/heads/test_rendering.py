"""Heads of a dub, segment by segment: the speech of each comes in pieces."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from dfrf import presets, saved_models
from dfrf.config import MarchConfig
from dfrf.fast.fast_method import FastMethod
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.face.mesh_points import CHIN
from dubbing.heads import rendering as heads
from dubbing.heads.frame_inputs import inputs_of, made_of, parted_lips, wanted_lips
from dubbing.identity.lip_scale import LipScale, Scale
from dubbing.media import VideoWriter, read_frames
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from tests.dfrf.people import small_config
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


def test_segments_with_pieces_of_the_speech_show_what_one_segment_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = 24
    path = tmp_path / "clip.mkv"
    with VideoWriter(path, 48, 40, Fraction(25), "ffv1") as writer:
        for _ in range(count):
            writer.write(np.full((40, 48, 3), 90, np.uint8))
    (tmp_path / "prepared").mkdir()
    clip = write_prepared(path, tmp_path / "prepared")
    random = np.random.default_rng(0)
    replace(clip, landmarks=random.random((count, 478, 2)) * 32).save()
    torch.manual_seed(0)
    config = small_config(references=0, use_warp=False)
    coarse = MarchConfig(resolution=24, step=0.4)  # so many heads are rendered
    model = presets.build(replace(config, march=coarse))
    saved_models.save_person(tmp_path / "model.safetensors", model, None, {})
    windows = random.random((count, 16, 8)).astype(np.float32)
    speech = SpeechFrames(windows, random.random((count, NUMBERS)).astype(np.float32))
    requests: list[tuple[int, int]] = []
    own_heads_of = heads.heads_of

    def heard(first: int, number: int) -> SpeechFrames:
        requests.append((first, number))
        return SpeechFrames(*(x[first : first + number] for x in (speech.windows, speech.lips)))

    def made(
        folder: Path,
        part: tuple[int, int] | None = None,
        strength: np.ndarray | None = None,
        lips: np.ndarray | None = None,
        last: Path | None = None,
        scale: Scale | None = None,
    ) -> list[np.ndarray]:
        heads.render(
            tmp_path / "model.safetensors",
            clip,
            heard,
            folder,
            pose_index=np.arange(count),
            part=part,
            strength=strength,
            lips=lips,
            scale=scale,
            device="cpu",
            last=last,
        )
        files = sorted(folder.glob("*.mkv"))
        return [p for file in files for p in read_frames(file, pixels="rgba")]

    whole = made(tmp_path / "one")
    assert requests == [(0, count)]
    monkeypatch.setattr(FastMethod, "segment", 8)
    parts = made(tmp_path / "three")
    assert requests[1:] == [(0, 15), (1, 22), (9, 15)]
    assert len(whole) == len(parts) == count
    for a, b in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(a, b)
    assert max(p[..., 3].max() for p in whole) > 200
    # In ranges, the last first: the same files, and what is there already is not asked for.
    del requests[:]
    made(tmp_path / "ranges", (16, 24))
    assert [file.name for file in (tmp_path / "ranges").glob("*.mkv")] == ["000016.mkv"]
    made(tmp_path / "ranges", (0, 16))
    made(tmp_path / "ranges")
    assert requests == [(9, 15), (0, 15), (1, 22)]
    for file in (tmp_path / "three").glob("*.mkv"):
        assert (tmp_path / "ranges" / file.name).read_bytes() == file.read_bytes()
    # Muted, it says what it says in silence, and not what is heard.
    muted = made(tmp_path / "muted", strength=np.zeros(count, np.float32))
    speech = SpeechFrames(np.zeros_like(windows), speech.lips)
    for a, b in zip(muted, made(tmp_path / "silent"), strict=True):
        np.testing.assert_allclose(a.astype(int), b, atol=1)
    assert max(np.abs(a.astype(int) - b).max() for a, b in zip(muted, whole, strict=True)) > 5
    # Muted in some frames, which lie in two segments, it is as muted there and as spoken beside.
    some = np.where((np.arange(count) >= 6) & (np.arange(count) < 10), 0, 1).astype(np.float32)
    speech = SpeechFrames(windows, speech.lips)
    for k, head in enumerate(made(tmp_path / "some", strength=some)):
        np.testing.assert_allclose(head.astype(int), (whole if some[k] else muted)[k], atol=1)
    # Frames made of the same as in the last result are taken from there.
    shown: list[int] = []

    def counted(*of: Any) -> Iterator[np.ndarray]:
        shown.append(int(of[-1].sum()))
        return own_heads_of(*of)

    monkeypatch.setattr(heads, "heads_of", counted)
    once = np.ones(count, np.float32)
    once[12] = 0
    again = made(tmp_path / "again", strength=once, last=tmp_path / "some")
    assert shown == [2, 3]  # frames 6 to 9 are as spoken again, and 12 is muted
    for head, alone in zip(again, made(tmp_path / "alone", strength=once), strict=True):
        np.testing.assert_array_equal(head, alone)
    assert shown == [2, 3, 8, 8, count - 16]
    for k, head in enumerate(again):
        np.testing.assert_allclose(head.astype(int), (muted if k == 12 else whole)[k], atol=1)
    # Where other pixels of the head are shown, it is not.
    clip.landmarks[20, CHIN] += 1
    made(tmp_path / "moved", strength=once, last=tmp_path / "again")
    assert shown[5:] == [1]
    clip.landmarks[20, CHIN] -= 1
    # A frame is made of the lips around it, too.
    reach = FastMethod.reach
    first = inputs_of(model, clip, speech, np.arange(count), 0, 8)
    other = replace(first, predicted_lips=first.predicted_lips.clone())
    other.predicted_lips[reach + 4] += 1
    both = (made_of(inputs, clip, np.arange(8)) for inputs in (first, other))
    changed = [k for k, (one, two) in enumerate(zip(*both, strict=True)) if one != two]
    assert changed == [k for k in range(8) if abs(k - 4) <= reach]
    # Lips that are given take the place of those heard: its own change nothing.
    own = wanted_lips(model, speech)
    assert own is not None
    parted = parted_lips(model, speech)
    for a, b in zip(made(tmp_path / "own", lips=parted), whole, strict=True):
        np.testing.assert_allclose(a.astype(int), b, atol=1)
    given = np.full((count, 8), np.nan, np.float32)
    given[6:10, :-1] = own[6:10] + 3
    wanted = wanted_lips(model, speech, lips=given)
    assert wanted is not None
    expected = np.where(np.isnan(given[:, :-1]), own, given[:, :-1])
    np.testing.assert_allclose(wanted, expected, atol=1e-3)
    for k, head in enumerate(made(tmp_path / "given", lips=given)):
        apart = np.abs(head.astype(int) - whole[k]).max()
        assert apart > 5 if 6 <= k < 10 else apart <= 1
    # Half as strong, it is further from the closed mouth where lips part late, by what is heard in
    # every frame, whichever segment that is in.
    half = np.full(count, 0.5, np.float32)
    late = LipScale(np.zeros(7), np.ones(7), 0.5)
    model.field.conditioning.closed_mouth_target.fill_(-2)
    saved_models.save_person(tmp_path / "model.safetensors", model, None, {})
    own, closed = (wanted_lips(model, speech, of) for of in (None, np.zeros(count)))
    assert own is not None
    assert closed is not None
    shares = late.shares(half, own[:, 0], closed[0, 0])
    assert (shares > 0.55).mean() > 0.5
    by_hand = made(tmp_path / "by hand", strength=shares)
    for a, b in zip(
        made(tmp_path / "half", strength=half, scale=lambda: late), by_hand, strict=True
    ):
        np.testing.assert_allclose(a.astype(int), b, atol=1)
    assert any(
        (a != b).any() for a, b in zip(by_hand, made(tmp_path / "h", strength=half), strict=True)
    )


def test_only_what_a_dub_shows_is_requested(tmp_path: Path) -> None:
    path = tmp_path / "clip.mkv"
    with VideoWriter(path, 48, 40, Fraction(25), "ffv1") as writer:
        for _ in range(4):
            writer.write(np.full((40, 48, 3), 90, np.uint8))
    clip = write_prepared(path, tmp_path, size=64, invalid=(2,))
    face, again, none = heads.regions_of(clip, np.array([1, 1, 2]))
    np.testing.assert_array_equal(face, again)
    assert not none.any()  # there the film stays as it is
    assert not face[:12].any()  # the forehead
    assert face[32:40, 32].all()  # the mouth
