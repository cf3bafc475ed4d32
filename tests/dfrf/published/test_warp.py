import torch

from dfrf.published.warp import WarpMLP

POINTS, CODE, FEATURES = torch.randn(7, 63), torch.randn(64), torch.randn(4, 7, 128)


def strong(max_offset: float = 10.0) -> WarpMLP:
    """A warp whose offsets are some pixels long."""
    torch.manual_seed(0)
    warp = WarpMLP(max_offset=max_offset)
    for layer in (*warp.layers, warp.out):
        torch.nn.init.normal_(layer.weight, std=0.15)
    return warp


def test_against_a_loop() -> None:
    warp = strong(max_offset=100.0)
    offsets = warp(POINTS, CODE, FEATURES)
    assert offsets.shape == (4, 7, 2)
    for n in range(4):
        for i in range(7):
            # The input order of the published network: point, speech, feature.
            x = torch.cat([POINTS[i], CODE, FEATURES[n, i]])
            for layer in warp.layers:
                assert isinstance(layer, torch.nn.Linear)
                x = (layer.weight @ x + layer.bias).clamp_min(0)
            row, column = (warp.out.weight @ x + warp.out.bias).tolist()
            torch.testing.assert_close(offsets[n, i], torch.tensor([column, row]))


def test_starts_next_to_the_identity() -> None:
    offsets = WarpMLP()(POINTS, CODE, FEATURES)
    assert 0 < offsets.abs().max() < 1e-4


def test_offsets_end_at_the_limit_without_gradient() -> None:
    warp = strong()
    with torch.no_grad():
        warp.out.bias.copy_(torch.tensor([50.0, 0.0]))
    offsets = warp(POINTS, CODE, FEATURES)
    assert (offsets[..., 1] == 10).all()
    offsets.sum().backward()
    assert warp.out.bias.grad is not None
    assert warp.out.bias.grad[0] == 0
    assert warp.out.bias.grad[1] != 0


def test_without_speech() -> None:
    warp = WarpMLP(code_dim=0)
    assert warp(POINTS, torch.zeros(0), FEATURES).shape == (4, 7, 2)
