"""What a tiny person's dub is made of: shares that add up, and changes that are told apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dfrf import presets, saved_models
from dfrf.cameras import Camera
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.rendering.baked_frame import BakedHead
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.workshop.lab import composition as lab
from dubbing.workshop.lab.composition import (
    CHANGES,
    LIKE,
    SOURCES,
    composition,
    painted,
    with_colour,
)
from tests import clips
from tests.dfrf.people import person, random_model, small_config
from tests.dfrf.rendering.test_baked_frame import learned
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium

FRAMES = 12


def test_painted_heads_show_how_much_each_source_counts() -> None:
    method, maps, inputs = learned(1)
    camera = Camera(inputs.c2w[0], inputs.focal, inputs.centres[0], inputs.size)
    head = method.speaking_heads(replace(inputs, baked=True), maps)(0)
    assert isinstance(head, BakedHead)
    shares = painted(head, camera)
    solid = shares[..., 3] > 0.98
    np.testing.assert_allclose(shares[..., :3].sum(-1), shares[..., 3], atol=1e-5)
    whole, crops, own = shares[solid][:, :3].T
    # Crops give all of the mouth, and nothing elsewhere.
    assert crops.max() > 0.95
    assert (crops < 0.01).mean() > 0.5
    assert whole[crops > 0.95].max() < 0.05
    assert own.min() > -0.05
    # A head of one grey: what references and crops give, and what is the field's own.
    grey = replace(
        head.images, whole=with_colour(head.images.whole, 0.5), mouths=head.images.mouths * 0
    )
    black = replace(grey, whole=grey.whole * torch.tensor([0, 0, 0, 1.0])[:, None, None])
    lit, dark = (replace(head, images=images).render(camera)[0] for images in (grey, black))
    np.testing.assert_allclose(((lit - dark).mean(-1) * 2)[solid], whole, atol=1e-3)


@pytest.fixture
def dubbed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[Path, PreparedClip, SpeechFrames]:
    """A model of a tiny person, with references and crops, and a prepared clip."""
    monkeypatch.setattr(lab, "refined", lambda model, maps, clip, frames, progress: clip)
    clips.write_video(tmp_path / "clip.mkv", FRAMES, codec="ffv1")
    (tmp_path / "prepared").mkdir()
    clip = write_prepared(tmp_path / "clip.mkv", tmp_path / "prepared")
    model, _ = random_model()
    method, someone = FastMethod(model), person()
    views = method.reference_views(someone, torch.tensor([0, 5]))
    method.finish(someone, views, 0)
    saved_models.save_person(tmp_path / "model.safetensors", model, views, {})
    random = np.random.default_rng(1)
    heard = person().predicted_lips[torch.arange(FRAMES) % 6].numpy()
    speech = SpeechFrames(random.random((FRAMES, 16, 8)).astype(np.float32), heard)
    return tmp_path / "model.safetensors", clip, speech


def measured(dubbed: tuple[Path, PreparedClip, SpeechFrames]) -> dict[str, float]:
    return composition(
        *(*dubbed, [(6, 6)], [(0, 5)]), device="cpu", progress=lambda message, share: None
    )


def test_shares_of_a_dub_add_up_and_changes_are_told_apart(
    dubbed: tuple[Path, PreparedClip, SpeechFrames],
) -> None:
    found = measured(dubbed)
    for place in ("replaced", "mouth"):
        shares = [found[f"{place} {source}"] for source in SOURCES]
        assert sum(shares) == pytest.approx(1)
        assert min(shares) > -0.01
    assert found["mouth crops"] > 0 < found["replaced crops"]  # its mouth is not where the box is
    changed = {name: found[f"{name} changes dB"] for name in CHANGES}
    assert all(np.isfinite(value) for value in changed.values())
    # Its lips were never learned, so speech noise alone leaves a part of it as it is.
    assert changed["no crops"] < LIKE
    assert changed["ellipsoid"] < LIKE


def test_a_method_without_crops_has_no_composition(
    dubbed: tuple[Path, PreparedClip, SpeechFrames], tmp_path: Path
) -> None:
    model = presets.build(small_config(references=0, use_warp=False))
    assert isinstance(model, FastModel)
    saved_models.save_person(tmp_path / "other.safetensors", model, None, {})
    assert measured((tmp_path / "other.safetensors", *dubbed[1:])) == {}
