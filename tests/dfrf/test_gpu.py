"""The product on a stand-in for a GPU: all that a step and a frame touch is where it should be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from dfrf import device as devices
from dfrf import presets
from dfrf.api import Head, load_head, render_frame, save_head
from dfrf.cameras import Camera
from dfrf.config import TrainConfig
from dfrf.data.dataset import neighbour_windows
from dfrf.fast.fast_method import FastMethod
from dfrf.field.speaker_adaptation import NUMBERS
from dfrf.method_interface import FrameInputs
from dfrf.training.fit import FitOptions, fit
from dfrf.training.validation import Validation
from tests.dfrf.people import FOCAL, SIZE, person, small_config
from tests.dfrf.stand_in_gpu import CPU, GPU, MixedDevicesError, StandInGpu

pytestmark = pytest.mark.medium


CONFIG = TrainConfig(
    iterations=2, rays=256, frames=4, warmup=1, occupancy_every=1, lip_iterations=2
)
REFERENCES = {"ellipsoid": torch.tensor([0, 5])}


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> Iterator[StandInGpu]:
    monkeypatch.setattr(devices, "choose", lambda _name="auto": GPU)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda: False)
    with StandInGpu() as mode:
        yield mode


def test_the_stand_in_keeps_devices_apart(gpu: StandInGpu) -> None:
    here = torch.ones(2, 3)
    there = here.to("cuda")
    assert (here.device, there.device) == (CPU, GPU)
    assert (there @ there.T).device == GPU
    assert [row.device for row in there] == [GPU, GPU]
    assert torch.arange(2, device=there.device).device == GPU
    assert there.new_zeros(1).device == there.max(0).values.device == GPU
    assert (2 * there + torch.tensor(1.0))[torch.tensor([0])].device == GPU
    assert there.cpu().device == here.to(torch.float64).device == CPU
    assert next(torch.nn.Linear(2, 2).to(GPU).parameters()).device == GPU
    for mixed in (
        lambda: here + there,
        lambda: torch.cat([here, there]),
        lambda: here[torch.tensor([0]).to(GPU)],
        lambda: there.index_select(0, torch.tensor([0])),
        there.numpy,
        lambda: torch.rand(2, device=GPU, generator=torch.Generator()),
    ):
        with pytest.raises(MixedDevicesError):
            mixed()


@pytest.mark.parametrize("learn_references_every", [0, 1])
def test_a_fine_tune_and_frames_of_fast(gpu: StandInGpu, learn_references_every: int) -> None:
    someone = person()
    model = presets.build(small_config())
    method = FastMethod(model)
    config = replace(CONFIG, learn_references_every=learn_references_every)
    curve = fit(method, [someone], config, REFERENCES, FitOptions(device="cuda"))
    assert len(curve.rows) == 2
    for name, tensor in [*model.named_parameters(), *model.named_buffers()]:
        assert tensor.device == GPU, name
    views = method.reference_views(someone, REFERENCES["ellipsoid"])
    method.finish(someone, views, seed=0)
    numbers = torch.tensor([1, 4])
    inputs = FrameInputs(
        someone.c2w[numbers].to(GPU),
        FOCAL,
        someone.centres[numbers].to(GPU),
        neighbour_windows(someone.windows, someone.segment, numbers).to(GPU),
        torch.zeros(2 + 2 * method.reach, NUMBERS, device=GPU),
        someone.expression[numbers].to(GPU),
        SIZE,
        torch.ones(2, SIZE, SIZE, dtype=torch.bool).to(GPU),
    )
    frames: list[tuple[Tensor, Tensor]] = list(method.render_frames(inputs, method.maps(views)))
    assert all(part.device == GPU for frame in frames for part in frame)
    assert frames[0][1].max() > 0.5
    assert gpu.calls[GPU] > 1000


def test_a_base_goes_on_from_its_state(gpu: StandInGpu, tmp_path: Path) -> None:
    people, held = [person(), replace(person(seed=1), name="other")], person(seed=2)
    config = replace(CONFIG, checkpoint_every=1, learn_references_every=1, augment=True)

    def options(stop: bool) -> FitOptions:
        validation = Validation([replace(held, name="held")])
        return FitOptions(str(tmp_path), None, lambda: stop, "cuda", validation)

    fit(FastMethod(presets.build(small_config())), people, config, None, options(stop=True))
    resumed = presets.build(small_config())
    curve = fit(FastMethod(resumed), people, config, None, options(stop=False))
    assert len(curve.rows) == 2
    assert {p.device for p in resumed.parameters()} == {GPU}


def test_a_person_is_kept_and_rendered_again(gpu: StandInGpu, tmp_path: Path) -> None:
    someone, path = person(), tmp_path / "model.safetensors"
    model = presets.build(small_config()).to(GPU)
    views = FastMethod(model).reference_views(someone, REFERENCES["ellipsoid"])
    save_head(path, Head.of(model, views))
    head = load_head(path, "cuda")
    camera = Camera(someone.c2w[2], FOCAL, someone.centres[2], SIZE)
    colour, opacity = render_frame(head, camera)
    assert colour.device == opacity.device == GPU
