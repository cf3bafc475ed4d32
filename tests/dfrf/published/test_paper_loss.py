import torch

from dfrf.published.paper_loss import mse


def test_mse() -> None:
    assert mse(torch.full((2, 3), 0.5), torch.zeros(2, 3)).item() == 0.25
