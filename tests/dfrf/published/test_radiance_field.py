import torch

from dfrf.published.radiance_field import RadianceMLP, density


def test_against_a_loop_forward_and_gradient() -> None:
    torch.manual_seed(0)
    net = RadianceMLP(input_dim=6, direction_dim=4, width=7, depth=5, skip=2, colour_width=3)
    inputs, directions = torch.randn(4, 6, requires_grad=True), torch.randn(4, 4)
    raw, raw_density = net(inputs, directions)
    assert raw.shape == (4, 3)
    assert raw_density.shape == (4,)
    rows = []
    for x, d in zip(inputs, directions, strict=True):
        h = x
        for i, layer in enumerate(net.layers):
            assert isinstance(layer, torch.nn.Linear)
            if i == 2:
                h = torch.cat([x, h])
            h = (layer.weight @ h + layer.bias).clamp_min(0)
        sigma = net.density.weight[0] @ h + net.density.bias[0]
        c = torch.cat([h, d])
        for layer in net.colour_layers:
            assert isinstance(layer, torch.nn.Linear)
            c = (layer.weight @ c + layer.bias).clamp_min(0)
        rows.append(torch.cat([net.colour.weight @ c + net.colour.bias, sigma[None]]))
    fast, slow = torch.cat([raw, raw_density[:, None]], -1), torch.stack(rows)
    torch.testing.assert_close(fast, slow)
    direction = torch.randn_like(fast)
    leaves = [inputs, *net.parameters()]
    one = torch.autograd.grad((fast * direction).sum(), leaves)
    other = torch.autograd.grad((slow * direction).sum(), leaves)
    for a, b in zip(one, other, strict=True):
        torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-5)


def test_density_does_not_see_the_direction() -> None:
    net = RadianceMLP()
    inputs = torch.randn(3, 383)
    a, b = net(inputs, torch.randn(3, 27)), net(inputs, torch.randn(3, 27))
    assert torch.equal(a[1], b[1])
    assert not torch.equal(a[0], b[0])


def test_density_is_never_negative() -> None:
    expected = torch.tensor([1e-6, 1e-6, 2.000001])
    torch.testing.assert_close(density(torch.tensor([-3.0, 0.0, 2.0])), expected)
