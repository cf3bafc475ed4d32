"""A step in shares: the gradient of the mean loss, however many threads work on it."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch

from dfrf import presets
from dfrf.config import TrainConfig
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_loss import matte_loss, share_outcome
from dfrf.fast.fast_method import FastMethod
from dfrf.training.fit import FitOptions, fit
from dfrf.training.ray_share import RayShare, draw_shares
from dfrf.training.step import step_outcome
from dfrf.workers import Workers
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.medium


CPU = torch.device("cpu")
CONFIG = TrainConfig(iterations=3, rays=192, frames=4, warmup=2, occupancy_every=2)


def shares(count: int) -> list[RayShare]:
    generator = torch.Generator().manual_seed(0)
    known = torch.randn(6, 70, generator=generator)
    return draw_shares(person(), known, CONFIG, generator, count)


def test_shares_divide_the_rays_and_the_frames() -> None:
    dealt = shares(4)
    assert [s.batch.frame.numel() for s in dealt] == [48] * 4
    assert [s.conditioning.shape for s in dealt] == [(1, 70)] * 4


@pytest.mark.usefixtures("arithmetic")
def test_gradients_are_those_of_the_mean_loss_and_reach_the_reference_network() -> None:
    model = presets.build(small_config())
    parameters: list[torch.Tensor] = [p for n, p in model.named_parameters() if "audio" not in n]
    dealt = shares(2)
    references = cut_references(person(), torch.tensor([0, 5]))
    maps = model.field.encoder(references)
    with Workers(CPU, 2) as workers:
        found = step_outcome(FastMethod(model), dealt, maps, CONFIG, 0, parameters, workers)
    # The same by one graph: each share's loss to the encoder's weights, one after the other.
    expected: dict[int, torch.Tensor] = {}
    for share in dealt:
        alone = share_outcome(
            model, share, model.field.encoder(references), CONFIG, True, parameters
        )
        for k, gradient in enumerate(alone.gradients):
            if gradient is not None:
                expected[k] = expected.get(k, torch.zeros_like(gradient)) + gradient / 2
    moved = {k for k, g in enumerate(found.gradients) if g is not None}
    assert moved == set(expected)
    encoder = {id(p) for p in model.field.encoder.parameters()}
    assert any(id(parameters[k]) in encoder for k in moved)
    for k in moved:
        mine = found.gradients[k]
        assert mine is not None
        torch.testing.assert_close(mine, expected[k], rtol=2e-2, atol=1e-4)


@pytest.fixture
def plain_operations() -> Iterator[None]:
    """Operations of one thread each: what is spread over threads is not added up in one order."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.usefixtures("plain_operations")
@pytest.mark.parametrize("every", [0, 1])
def test_one_thread_and_four_give_the_same_model(
    monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    trained = []
    for cores in (1, 4):
        monkeypatch.setattr(torch, "get_num_threads", lambda cores=cores: cores)
        torch.manual_seed(1)
        model = presets.build(small_config())
        config = replace(CONFIG, learn_references_every=every)
        someone = person()
        references = {someone.name: torch.tensor([0, 5])}
        fit(FastMethod(model), [someone], config, references, FitOptions(device="cpu"))
        trained.append(model.state_dict())
    for name, value in trained[0].items():
        assert torch.equal(value, trained[1][name]), name


def test_a_matte_teaches_only_where_it_is_sure() -> None:
    opacity = torch.tensor([0.5, 0.5, 0.5, 0.5], requires_grad=True)
    loss = matte_loss(opacity, torch.tensor([0.0, 0.3, 0.9, 1.0]))
    (gradient,) = torch.autograd.grad(loss, opacity)
    torch.testing.assert_close(gradient, torch.tensor([0.25, 0, 0, -0.25]))
    torch.testing.assert_close(loss.detach(), torch.tensor(0.125))
