import torch
from torch import Tensor

from dfrf.published.sampling import importance, inverse_cdf, stratified

NEAR, FAR = torch.tensor([0.5, 1.0]), torch.tensor([1.5, 4.0])


def slow_inverse_cdf(edges: list[float], weights: list[float], u: float) -> float:
    """Walks along the bins until u of the weight lies behind."""
    total = sum(w + 1e-5 for w in weights)
    behind = 0.0
    for k, w in enumerate(weights):
        share = (w + 1e-5) / total
        if u < behind + share or k == len(weights) - 1:
            return edges[k] + (u - behind) / share * (edges[k + 1] - edges[k])
        behind += share
    raise AssertionError


def test_even_depths_include_both_ends() -> None:
    depths = stratified(NEAR, FAR, 5)
    torch.testing.assert_close(depths[0], torch.tensor([0.5, 0.75, 1.0, 1.25, 1.5]))
    torch.testing.assert_close(depths[1], torch.tensor([1.0, 1.75, 2.5, 3.25, 4.0]))


def test_jitter_stays_in_its_stratum_and_far_stays() -> None:
    even = stratified(NEAR, FAR, 5)
    middle = (even[:, 1:] + even[:, :-1]) / 2
    low = stratified(NEAR, FAR, 5, torch.zeros(2, 5))
    high = stratified(NEAR, FAR, 5, torch.ones(2, 5))
    torch.testing.assert_close(low[:, 1:-1], middle[:, :-1])
    torch.testing.assert_close(high[:, :-1], middle)
    torch.testing.assert_close(low[:, -1], FAR)
    moved = stratified(NEAR, FAR, 5, torch.rand(2, 5))
    assert (moved >= low).all()
    assert (moved <= high).all()


def test_inverse_cdf_against_a_loop() -> None:
    generator = torch.Generator().manual_seed(1)
    edges = torch.rand(4, 7, generator=generator, dtype=torch.float64).cumsum(-1)
    weights = torch.rand(4, 6, generator=generator, dtype=torch.float64)
    u = torch.rand(4, 9, generator=generator, dtype=torch.float64)
    drawn = inverse_cdf(edges, weights, u)
    for r in range(4):
        for i in range(9):
            expected = slow_inverse_cdf(edges[r].tolist(), weights[r].tolist(), u[r, i].item())
            assert abs(drawn[r, i].item() - expected) < 1e-9


def test_equal_weights_leave_u_as_it_is() -> None:
    edges = torch.linspace(0, 1, 6)[None]
    u = torch.linspace(0, 1, 11)[None]
    torch.testing.assert_close(inverse_cdf(edges, torch.ones(1, 5), u), u, atol=1e-6, rtol=0)


def test_no_weight_anywhere_still_draws_inside() -> None:
    edges = torch.linspace(2, 3, 6)[None]
    drawn = inverse_cdf(edges, torch.zeros(1, 5), torch.linspace(0, 1, 8)[None])
    assert drawn.isfinite().all()
    assert 2 <= drawn.min() <= drawn.max() <= 3


def test_samples_gather_where_the_weight_is() -> None:
    depths = torch.linspace(0, 1, 11)[None]
    weights = torch.zeros(1, 11)
    weights[0, 4] = 1.0
    fine = importance(depths, weights, torch.linspace(0, 1, 20)[None])
    assert fine.shape == (1, 31)
    assert (fine.diff() >= 0).all()
    near = ((fine > 0.349) & (fine < 0.451)).sum()
    assert near >= 19


def test_first_and_last_weight_do_not_count_and_no_gradient_flows() -> None:
    depths = stratified(NEAR, FAR, 6)
    weights = torch.rand(2, 6, requires_grad=True)
    u: Tensor = torch.linspace(0, 1, 4)[None]
    fine = importance(depths, weights, u)
    assert not fine.requires_grad
    other = weights.detach().clone()
    other[:, [0, -1]] = 7.0
    torch.testing.assert_close(importance(depths, other, u), fine)
