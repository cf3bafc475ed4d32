import math

import torch
from torch.autograd import gradcheck

from dfrf.field.encodings import encoded_size, frequency_encoding


def test_order_is_identity_then_sine_and_cosine_of_each_octave() -> None:
    x = torch.tensor([0.3, -1.2, 2.0])
    expected = list(x.tolist())
    for octave in range(4):
        expected += [math.sin(2**octave * v) for v in x.tolist()]
        expected += [math.cos(2**octave * v) for v in x.tolist()]
    torch.testing.assert_close(frequency_encoding(x, 4), torch.tensor(expected))


def test_published_widths() -> None:
    assert [encoded_size(octaves) for octaves in (10, 4, 5, 0)] == [63, 27, 33, 3]
    for octaves in (10, 4, 5, 0):
        encoded = frequency_encoding(torch.zeros(2, 5, 3), octaves)
        assert encoded.shape == (2, 5, encoded_size(octaves))


def test_gradient() -> None:
    x = torch.randn(2, 3, dtype=torch.float64, requires_grad=True)
    assert gradcheck(lambda v: frequency_encoding(v, 3), x)
