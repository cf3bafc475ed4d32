import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.published.slot_attention import ROUNDS, SlotAttention, slot_weights


def small(slots: int = 2) -> SlotAttention:
    torch.manual_seed(3)
    return SlotAttention(token_dim=6, point_dim=5, dim=8, slots=slots, squeezed=4)


def slow_aggregation(net: SlotAttention, tokens: Tensor, points: Tensor, noise: Tensor) -> Tensor:
    """Point by point, slot by slot, reference by reference, (M, K * D)."""
    results = []
    for m in range(points.shape[0]):
        keys, values = [], []
        for token in tokens[:, m]:
            summary = net.squeeze2(net.squeeze1(token).clamp_min(0))
            joined = net.embed(torch.cat([token, points[m], summary]))
            x = net.norm_input(torch.where(joined > 0, joined, 0.01 * joined))
            keys.append(net.key(x))
            values.append(net.value(x))
        slots = [net.mean + net.log_deviation.exp() * noise[m, k] for k in range(net.slots)]
        for _ in range(ROUNDS):
            shares = []
            for key in keys:
                logits = [net.query(net.norm_slots(s)) @ key / len(key) ** 0.5 for s in slots]
                shares.append(torch.stack(logits).exp() / torch.stack(logits).exp().sum() + 1e-8)
            table = torch.stack(shares)
            table = table / table.sum(0)
            renewed = []
            for k, slot in enumerate(slots):
                update = sum(table[n, k] * value for n, value in enumerate(values))
                assert isinstance(update, Tensor)
                # A gated recurrent unit, written out.
                gates_in = net.gru.weight_ih @ update + net.gru.bias_ih
                gates_state = net.gru.weight_hh @ slot + net.gru.bias_hh
                (r_in, z_in, n_in), (r, z, n) = gates_in.chunk(3), gates_state.chunk(3)
                keep = torch.sigmoid(z_in + z)
                fresh = torch.tanh(n_in + torch.sigmoid(r_in + r) * n)
                state = (1 - keep) * fresh + keep * slot
                renewed.append(state + net.mlp2(net.mlp1(net.norm_mlp(state)).clamp_min(0)))
            slots = renewed
        results.append(torch.cat(slots))
    return torch.stack(results)


def test_against_a_loop_forward_and_gradient() -> None:
    net = small()
    tokens = torch.randn(3, 5, 6, requires_grad=True)
    points, noise = torch.randn(5, 5), torch.randn(5, 2, 8)
    fast, slow = net(tokens, points, noise), slow_aggregation(net, tokens, points, noise)
    torch.testing.assert_close(fast, slow, atol=1e-5, rtol=1e-5)
    direction = torch.randn_like(fast)
    inputs = [tokens, *net.parameters()]
    one = torch.autograd.grad((fast * direction).sum(), inputs)
    other = torch.autograd.grad((slow * direction).sum(), inputs)
    for a, b in zip(one, other, strict=True):
        torch.testing.assert_close(a, b, atol=1e-4, rtol=1e-4)


def test_no_noise_equals_noise_of_zero() -> None:
    net, tokens, points = small(), torch.randn(4, 6, 6), torch.randn(6, 5)
    quiet = net(tokens, points)
    assert quiet.shape == (6, 16)
    torch.testing.assert_close(quiet, net(tokens, points, torch.zeros(6, 2, 8)))
    torch.testing.assert_close(quiet, slow_aggregation(net, tokens, points, torch.zeros(6, 2, 8)))


def test_one_noise_for_all_points() -> None:
    net, tokens, points = small(), torch.randn(4, 6, 6), torch.randn(6, 5)
    noise = torch.randn(1, 2, 8)
    torch.testing.assert_close(
        net(tokens, points, noise), net(tokens, points, noise.expand(6, -1, -1))
    )


def test_the_order_of_the_references_does_not_matter() -> None:
    net, tokens, points = small(), torch.randn(4, 6, 6), torch.randn(6, 5)
    noise = net.noise(6)
    other = net(tokens[[2, 0, 3, 1]], points, noise)
    torch.testing.assert_close(net(tokens, points, noise), other)


def test_noise_repeats_with_its_generator() -> None:
    net = small()
    noise = [net.noise(4, torch.Generator().manual_seed(5)) for _ in range(2)]
    assert noise[0].shape == (4, 2, 8)
    assert torch.equal(*noise)


def test_rendering_starts_each_sample_elsewhere_and_always_there() -> None:
    start = small().rendering_noise(95)
    torch.manual_seed(8)
    assert torch.equal(start, small().rendering_noise(95))
    assert start.shape == (95, 2, 8)
    assert len(start.flatten(0, 1).unique(dim=0)) == 95 * 2
    assert abs(float(start.mean())) < 0.1
    assert abs(float(start.std()) - 1) < 0.1


def test_shares_of_each_slot_sum_to_one() -> None:
    weights = slot_weights(torch.randn(5, 2, 8), 3 * torch.randn(4, 5, 8))
    torch.testing.assert_close(weights.sum(0), torch.ones(5, 2))
    assert F.relu(-weights).max() == 0


def test_any_number_of_references() -> None:
    net = SlotAttention()
    for count in (1, 2, 4, 6):
        assert net(torch.randn(count, 3, 130), torch.randn(3, 63)).shape == (3, 256)
