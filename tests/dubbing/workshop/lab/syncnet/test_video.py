"""The published arithmetic over a whole file, in batches, beside the same in one piece."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from dubbing import media
from dubbing.workshop.lab.syncnet import check as published
from dubbing.workshop.lab.syncnet.mfcc import mfcc
from dubbing.workshop.lab.syncnet.syncnet_network import PublishedSyncNet
from tests.dubbing.conftest import Speaker
from tests.dubbing.workshop.lab.syncnet.test_check import whole_curve

pytestmark = pytest.mark.medium


class Projections(PublishedSyncNet):
    """Fixed random projections in place of the convolutions, which take minutes here."""

    def __init__(self) -> None:
        nn.Module.__init__(self)
        generator = torch.Generator().manual_seed(0)
        self.ears = nn.Parameter(torch.randn(13 * 20, 1024, generator=generator) / 100)
        self.eyes = nn.Parameter(torch.randn(3 * 5, 1024, generator=generator) / 100)

    def embed_sound(self, mfcc: Tensor) -> Tensor:
        return mfcc.flatten(1) @ self.ears

    def embed_mouth(self, frames: Tensor) -> Tensor:
        return frames.mean((3, 4)).flatten(1) @ self.eyes


def test_batches_give_the_whole(speaker: Speaker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(published, "SOUND_BATCH", 3 * published.BATCH)
    network = Projections()
    boxes = np.tile([48.0, 48.0, 30.0], (100, 1))
    found = published.published_measure(network, speaker.clip, boxes)
    assert found is not None
    estimate, curve = found
    n = published.windows_of(100, len(speaker.sound))
    assert n == 95
    cepstra = torch.from_numpy(mfcc(np.round(speaker.sound * 32768))).float()
    sound = published.embed_cepstra(network, cepstra)[:n]
    crops = [published.crop_face(f, boxes[0]) for f in speaker.frames[: n + 4]]
    mouth = torch.cat(list(published.embed_frames(network, crops)))
    with torch.no_grad():
        whole = whole_curve(mouth, sound)
    # Seeking in the sound may round a sample differently.
    assert np.allclose(curve, whole.flip(0).numpy(), rtol=2e-3)
    assert estimate.offset == published.published_estimate(whole).offset
    assert estimate.distance == pytest.approx(float(curve.min()))


def test_boxes_of_a_video(speaker: Speaker) -> None:
    (boxes,) = published.track_boxes(speaker.clip, 100).values()
    smooth = published.face_boxes(boxes)
    assert smooth.shape == (100, 3)
    assert np.abs(smooth[:, :2] - 48).max() < 12
    assert 15 < smooth[:, 2].mean() < 48


def test_too_short_for_a_window(speaker: Speaker) -> None:
    assert published.published_measure(Projections(), speaker.clip, np.zeros((4, 3))) is None
    assert media.probe(speaker.clip).frames == 100
