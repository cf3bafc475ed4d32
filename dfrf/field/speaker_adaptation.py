"""How one person's lips follow speech, learned from the seconds of that person.

What the lips of people in general would do is predicted from the sound, outside of this package: L
lip measures and a score that rises where lips touch. How wide this person's get, how long they stay
open, how early they close and how often they touch, a few seconds of them show.

C frames in a row, F of them adapted, R = REACH frames to each side, P = L + 1 predicted numbers.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

LIP_MEASURES = 7
OPENING, WIDTH = 0, 3  # of the lip measures: the gap in the middle, the mouth's width
TOUCHING = LIP_MEASURES  # place of the score among the predicted numbers
PREDICTED = LIP_MEASURES + 1
REACH = 3  # frames to each side that count for a frame's lips
OWN = slice(REACH * PREDICTED, (REACH + 1) * PREDICTED)  # the frame's own in a row of neighbours
# Weight of the general prediction, in frames, for each measure, and its assumed correlation with
# this person's lips. Both were chosen on people left out. A few frames determine the width badly.
PRIOR = (800.0, 800.0, 800.0, 5000.0, 800.0, 800.0, 800.0)
AGREEMENT = 0.6
SMOOTHING = (0.25, 0.5, 0.25)  # of the score over neighbouring frames: no lips twitch
OPEN = 1.0  # what an opening of one spread takes off the score of touching lips
SOFTNESS = 0.2  # of the score's spread: from half closed to closed
ROUNDS = 8
CLOSED_SHARE = 0.05  # of the frames, the least open ones: a closed mouth
NEVER = (0.0, 0.0, -1e4)  # a score that is never reached


def rows_of_neighbours(values: Float[Tensor, "N K"]) -> Float[Tensor, "F RK"]:
    """Numbers of N = F + 2 R frames in a row: each frame's with those of R to each side.

    Returns:
        (2 R + 1) K numbers a frame, the earliest first.
    """
    return values.unfold(0, 2 * REACH + 1, 1).mT.flatten(1)


def extended(values: Float[Tensor, "C K"]) -> Float[Tensor, "N K"]:
    """The same with the first and the last frame R times more, N = C + 2 R."""
    return torch.cat([values[:1].expand(REACH, -1), values, values[-1:].expand(REACH, -1)])


def smoothed_score(predicted: Float[Tensor, "N P"]) -> Float[Tensor, " F"]:
    """The score of touching lips, over neighbouring frames; N = F + 2 R."""
    kernel = predicted.new_tensor(SMOOTHING)[None, None]
    wide: Tensor = F.conv1d(predicted[None, None, :, TOUCHING], kernel).view(-1)
    cut = REACH - len(SMOOTHING) // 2
    return wide[cut : len(wide) - cut]


def with_closures(
    lips: Float[Tensor, "F L"], share: Float[Tensor, " F"], closed: Float[Tensor, " L"]
) -> Float[Tensor, "F L"]:
    """Lips moved towards closed ones by `share`; their width stays."""
    shares = share[:, None].repeat(1, LIP_MEASURES)
    shares[:, WIDTH] = 0
    return lips + shares * (closed - lips)


def closed_mouth(lips: Float[Tensor, "C L"]) -> Float[Tensor, " L"]:
    """Lip measures of a closed mouth: the mean of the least open frames."""
    least = lips[:, OPENING].argsort()[: max(1, round(CLOSED_SHARE * len(lips)))]
    return lips[least].mean(0)


def closure_score(
    predicted: Float[Tensor, "C P"], opening: Float[Tensor, " C"], touching: float
) -> Float[Tensor, 3]:
    """The score by which lips touch in a share `touching` of the frames; see `SpeakerAdaptation`.

    Args:
        opening: of mean 0 and spread 1.
    """
    if not touching:
        return predicted.new_tensor(NEVER)
    smooth = smoothed_score(extended(predicted))
    size = smooth.std().clamp_min(1e-6)
    score = smooth / size - OPEN * opening
    soft = SOFTNESS * score.std().clamp_min(1e-6)
    return torch.stack([1 / (size * soft), -OPEN / soft, -score.quantile(1 - touching) / soft])


class SpeakerAdaptation(nn.Module):
    """This person's lips, from those of people in general: a linear map, and where they touch.

    Lips touch where the score is high, less so where the linear map opens them further.

    Attributes:
        score: two numbers that the score of a frame and its opening are multiplied by, and a third
            that is added; lips are half closed at 0, more so above.
    """

    score: Float[Tensor, 3]

    def __init__(self) -> None:
        super().__init__()
        self.linear = nn.Linear((2 * REACH + 1) * PREDICTED, LIP_MEASURES)
        nn.init.zeros_(self.linear.bias)
        nn.init.zeros_(self.linear.weight)
        with torch.no_grad():
            self.linear.weight[:, OWN][:, :LIP_MEASURES] = torch.eye(LIP_MEASURES)
        self.register_buffer("score", torch.tensor(NEVER))

    def forward(
        self, predicted: Float[Tensor, "N P"], closed: Float[Tensor, " L"]
    ) -> Float[Tensor, "F L"]:
        """The person's lips in F frames.

        Args:
            predicted: of these frames and of those beside them, N = F + 2 R.
            closed: their measures where their mouth is closed.
        """
        lips = self.linear(rows_of_neighbours(predicted))
        of_score, of_opening, offset = self.score.to(predicted)
        share = of_score * smoothed_score(predicted) + of_opening * lips[:, OPENING] + offset
        return with_closures(lips, share.sigmoid(), closed)

    @torch.no_grad()
    def fit(
        self,
        predicted: Float[Tensor, "C P"],
        lips: Float[Tensor, "C L"],
        touching: Float[Tensor, " C"],
        mean: Float[Tensor, " L"],
        spread: Float[Tensor, " L"],
    ) -> None:
        """Learns from frames of the person.

        A ridge regression of what is left when lips are taken as predicted. Its answers, closures
        among them, get the given mean and spread: a regression alone would open
        the mouth less than the person does.

        Args:
            lips: measured, of mean 0 and variance 1.
            touching: 1 where the person's lips touch.
            mean, spread: of the answers.
        """
        if len(predicted) < 2:
            return
        predicted = predicted.double()
        middle, size = predicted.mean(0), predicted.std(0).clamp_min(1e-6)
        near = rows_of_neighbours(extended((predicted - middle) / size))
        weight = ridge(near, lips.to(near))
        answer = near @ weight
        factor = 1 / answer.std(0).clamp_min(1e-6)
        opening = answer[:, OPENING] * factor[OPENING]
        score = closure_score(predicted, opening, float(touching.mean()))
        of_score, of_opening, offset = score
        share = of_score * smoothed_score(extended(predicted)) + of_opening * opening + offset
        closed = closed_mouth(lips).to(answer)
        scale, shift = standardising(answer * factor, share.sigmoid(), closed)
        factor = factor * scale * spread.to(factor)
        shift = mean.to(shift) + spread.to(shift) * shift
        weight = (weight / size.repeat(2 * REACH + 1)[:, None] * factor).T
        self.linear.weight.copy_(weight)
        self.linear.bias.copy_(shift - weight @ middle.repeat(2 * REACH + 1))
        # The score was found for an opening of mean 0 and spread 1.
        score[1] /= scale[OPENING] * spread[OPENING].to(scale)
        score[2] -= score[1] * shift[OPENING]
        self.score.copy_(score)


def ridge(near: Float[Tensor, "C RP"], lips: Float[Tensor, "C L"]) -> Float[Tensor, "RP L"]:
    """Weights that give the lips, held to AGREEMENT times what is predicted of the frame itself."""
    known = AGREEMENT * near[:, OWN][:, :LIP_MEASURES]
    square, product = near.T @ near, near.T @ (lips - known)
    weight = torch.zeros_like(product)
    for k, prior in enumerate(PRIOR):
        held = square + prior * torch.eye(len(square)).to(square)
        weight[:, k] = torch.linalg.solve(held, product[:, k])
    weight[OWN][:LIP_MEASURES] += AGREEMENT * torch.eye(LIP_MEASURES).to(weight)
    return weight


def standardising(
    answer: Float[Tensor, "C L"], share: Float[Tensor, " C"], closed: Float[Tensor, " L"]
) -> tuple[Float[Tensor, " L"], Float[Tensor, " L"]]:
    """What to multiply answers by and to add, so that lips with closures have mean 0, variance 1.

    Closed lips count in both, so a few rounds find what the rest needs.
    """
    scale, shift = torch.ones(LIP_MEASURES).to(answer), torch.zeros(LIP_MEASURES).to(answer)
    for _ in range(ROUNDS):
        made = with_closures(answer * scale + shift, share, closed)
        scale = scale * (1 / made.std(0).clamp_min(1e-3)).clamp(0.5, 2)
        shift = shift - made.mean(0)
    return scale, shift
