import pytest
import torch
from torch import Tensor

from dfrf.data.dataset import neighbour_windows
from dfrf.field.audio import NEIGHBOURS, AudioAttNet, AudioNet, attend


def leak(x: Tensor) -> Tensor:
    return torch.where(x > 0, x, 0.02 * x)


def slow_convolution(x: Tensor, layer: torch.nn.Conv1d) -> Tensor:
    """(channels, length) through a convolution of 3 with padding 1, output by output."""
    assert layer.bias is not None
    stride = layer.stride[0]
    padded = torch.cat([x.new_zeros(x.shape[0], 1), x, x.new_zeros(x.shape[0], 1)], 1)
    steps = [
        (layer.weight * padded[None, :, at : at + 3]).sum((1, 2)) + layer.bias
        for at in range(0, x.shape[1], stride)
    ]
    return torch.stack(steps, 1)


def test_audio_net_against_a_loop() -> None:
    net = AudioNet(speech_dim=5, code_dim=6, widths=(4, 4, 6))
    windows = torch.randn(2, 3, 16, 5)
    codes = net(windows)
    assert codes.shape == (2, 3, 6)
    for i in range(2):
        for j in range(3):
            x = windows[i, j].T
            for layer in net.convolutions:
                assert isinstance(layer, torch.nn.Conv1d)
                x = leak(slow_convolution(x, layer))
            assert x.shape == (6, 1)
            hidden = leak(net.hidden.weight @ x[:, 0] + net.hidden.bias)
            expected = net.out.weight @ hidden + net.out.bias
            torch.testing.assert_close(codes[i, j], expected)


def test_attention_against_a_loop() -> None:
    net = AudioAttNet(attended=3, neighbours=8, widths=(5, 4))
    codes = torch.randn(2, 8, 7)
    smoothed = net(codes)
    for i in range(2):
        x = codes[i, :, :3].T
        for layer in net.convolutions:
            assert isinstance(layer, torch.nn.Conv1d)
            x = leak(slow_convolution(x, layer))
        logits = (net.out.weight @ x[0] + net.out.bias).exp()
        expected = sum(logits[k] / logits.sum() * codes[i, k] for k in range(8))
        torch.testing.assert_close(smoothed[i], expected)


def test_equal_logits_give_the_mean() -> None:
    codes = torch.randn(8, 64)
    torch.testing.assert_close(attend(codes, torch.zeros(8)), codes.mean(0))


def test_attention_looks_at_the_first_half_and_blends_all_of_it() -> None:
    net, codes = AudioAttNet(), torch.randn(8, 64)
    other = codes.clone()
    other[:, 32:] += 1
    torch.testing.assert_close(net.logits(other), net.logits(codes))
    torch.testing.assert_close(net(other)[32:], net(codes)[32:] + 1)


def test_gradients_reach_every_parameter() -> None:
    audio, attention = AudioNet(), AudioAttNet()
    attention(audio(torch.randn(8, 16, 29))).square().sum().backward()
    for parameter in (*audio.parameters(), *attention.parameters()):
        assert parameter.grad is not None
        assert parameter.grad.abs().sum() > 0


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 9])
def test_neighbours_are_four_before_to_three_after_in_the_same_shot(frame: int) -> None:
    windows = torch.arange(10.0)[:, None, None].expand(10, 16, 2)
    shot = torch.tensor([0] * 6 + [1] * 4)
    near = neighbour_windows(windows, shot, torch.tensor([frame]))
    assert near.shape == (1, NEIGHBOURS, 16, 2)
    low, high = (0, 5) if frame < 6 else (6, 9)
    expected = [min(max(i, low), high) for i in range(frame - 4, frame + 4)]
    assert near[0, :, 7, 1].tolist() == expected
