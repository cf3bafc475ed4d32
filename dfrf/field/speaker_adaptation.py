"""Speaker adaptation: how one person's lips follow speech, fitted to that person's clip.

A network outside this package predicts lips from the sound without knowing the speaker: L lip
measures and a score that rises where lips touch. H features of the sound come with them. The fit
finds how this person's lips differ from the prediction, and how often they touch.

C frames in a row, F of them adapted, P = L + 1 + H numbers a frame, R = CONTEXT_FRAMES.
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
HEARD = 32
NUMBERS = PREDICTED + HEARD
NEIGHBOURS = 2  # frames to each side that a frame's lips are predicted from
SMOOTHING = (0.25, 0.5, 0.25)  # of the score over neighbouring frames: lips must not twitch
# Frames to each side that count for a frame's lips.
CONTEXT_FRAMES = NEIGHBOURS + len(SMOOTHING) // 2
OWN = slice(NEIGHBOURS * NUMBERS, NEIGHBOURS * NUMBERS + PREDICTED)  # in a row of neighbours
# Weight of the prediction, in frames, for each of its numbers; chosen on held-out people. A few
# frames determine the width badly.
PRIOR = (1000.0, 1000.0, 1000.0, 3000.0, 1000.0, 1000.0, 1000.0, 1000.0)
FOLDS = 4  # of the cross-validation over the frames
OPEN = 1.0  # how much an opening of one standard deviation lowers the score of touching lips
SOFTNESS = 0.2  # of the score's standard deviation: from half closed to closed
ROUNDS = 8
CLOSED_SHARE = 0.05  # of the frames, the least open ones: a closed mouth
NEVER = (0.0, 0.0, -1e4)  # a score that is never reached


def rows_of_neighbours(values: Float[Tensor, "N K"]) -> Float[Tensor, "M RK"]:
    """Rows that join the numbers of each frame and its neighbours, from N = M + 2 NEIGHBOURS.

    Returns:
        (2 NEIGHBOURS + 1) K numbers a frame, the earliest first.
    """
    return values.unfold(0, 2 * NEIGHBOURS + 1, 1).mT.flatten(1)


def extended(values: Float[Tensor, "C K"], frames: int = CONTEXT_FRAMES) -> Float[Tensor, "N K"]:
    """Values with the first and the last frame repeated `frames` times, N = C + 2 frames."""
    first, last = values[:1].expand(frames, -1), values[-1:].expand(frames, -1)
    return torch.cat([first, values, last])


def smoothed(score: Float[Tensor, " M"]) -> Float[Tensor, " F"]:
    """The score of touching lips, smoothed over neighbouring frames, M = F + 2."""
    wide: Tensor = F.conv1d(score[None, None], score.new_tensor(SMOOTHING)[None, None])
    return wide.view(-1)


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
    smooth: Float[Tensor, " C"], opening: Float[Tensor, " C"], touching: float
) -> Float[Tensor, 3]:
    """Numbers of `SpeakerAdaptation.score` so that lips touch in a share `touching` of the frames.

    Args:
        smooth: smoothed score.
        opening: of mean 0 and variance 1.
    """
    if not touching:
        return smooth.new_tensor(NEVER)
    size = smooth.std().clamp_min(1e-6)
    score = smooth / size - OPEN * opening
    soft = SOFTNESS * score.std().clamp_min(1e-6)
    return torch.stack([1 / (size * soft), -OPEN / soft, -score.quantile(1 - touching) / soft])


class SpeakerAdaptation(nn.Module):
    """From predicted lips to this person's: a linear map, and closures where lips touch.

    Lips touch where the score is high, less so where the linear map opens them further.

    Attributes:
        linear: from the predicted lips and sound features of a frame and its neighbours to this
            person's lip measures and score; at first, the prediction itself.
        score: factors of the score and of the opening of a frame, and an offset; lips are half
            closed where the sum is 0, more closed above.
    """

    score: Float[Tensor, 3]

    def __init__(self) -> None:
        super().__init__()
        self.linear = nn.Linear((2 * NEIGHBOURS + 1) * NUMBERS, PREDICTED)
        nn.init.zeros_(self.linear.bias)
        nn.init.zeros_(self.linear.weight)
        with torch.no_grad():
            self.linear.weight[:, OWN] = torch.eye(PREDICTED)
        self.register_buffer("score", torch.tensor(NEVER))

    def forward(
        self, predicted: Float[Tensor, "N P"]
    ) -> tuple[Float[Tensor, "F L"], Float[Tensor, " F"]]:
        """The person's lips in F frames but for closures, and how far they are to be closed, 0..1.

        Args:
            predicted: predicted lips and sound features of these frames and of R to each side,
                N = F + 2 R.
        """
        answer = self.linear(rows_of_neighbours(predicted))
        lips = answer[1:-1, :LIP_MEASURES]
        of_score, of_opening, offset = self.score.to(predicted)
        share = of_score * smoothed(answer[:, TOUCHING]) + of_opening * lips[:, OPENING] + offset
        return lips, share.sigmoid()

    @torch.no_grad()
    def fit(
        self,
        predicted: Float[Tensor, "C P"],
        lips: Float[Tensor, "C L"],
        touching: Float[Tensor, " C"],
    ) -> None:
        """Fits the adaptation to frames of the person.

        A ridge regression predicts the difference of the person's lips from the predicted ones. Its
        answers, closures included, are scaled to mean 0 and variance 1: a regression alone would
        open the mouth less than the person does. Scale and score are computed on held-out answers,
        because the regression overfits its own frames.

        Args:
            predicted: predicted lips and sound features.
            lips: measured, of mean 0 and variance 1.
            touching: 1 where the person's lips touch.
        """
        if len(predicted) < 2:
            return
        predicted, touching = predicted.double(), touching.double()
        middle, size = predicted.mean(0), predicted.std(0).clamp_min(1e-6)
        near = rows_of_neighbours(extended((predicted - middle) / size, NEIGHBOURS))
        wanted = torch.cat([lips.to(near), (touching - touching.mean())[:, None]], 1)
        rest = wanted - (predicted - middle)[:, :PREDICTED]
        answer = held_out_answers(near, rest) + (predicted - middle)[:, :PREDICTED]
        factor = torch.ones(PREDICTED).to(answer)
        factor[:LIP_MEASURES] /= answer[:, :LIP_MEASURES].std(0).clamp_min(1e-6)
        answer = (answer - answer.mean(0)) * factor
        smooth = smoothed(extended(answer[:, TOUCHING:], 1)[:, 0])
        own = answer[:, :LIP_MEASURES]
        score = closure_score(smooth, own[:, OPENING], float(touching.mean()))
        of_score, of_opening, offset = score
        share = of_score * smooth + of_opening * own[:, OPENING] + offset
        scale, shift = standardising(own, share.sigmoid(), closed_mouth(lips).to(own))
        moved = torch.zeros(PREDICTED).to(answer)
        moved[:LIP_MEASURES] = shift
        factor[:LIP_MEASURES] *= scale
        weight = ridge(near, rest) / size.repeat(2 * NEIGHBOURS + 1)[:, None]
        weight[OWN] += torch.eye(PREDICTED).to(weight)
        weight = (weight * factor).T
        self.linear.weight.copy_(weight)
        self.linear.bias.copy_(moved - weight @ middle.repeat(2 * NEIGHBOURS + 1))
        # The score was computed for an opening of mean 0 and variance 1.
        score[1] /= scale[OPENING]
        score[2] -= score[1] * shift[OPENING]
        self.score.copy_(score)


def ridge(near: Float[Tensor, "C RP"], rest: Float[Tensor, "C S"]) -> Float[Tensor, "RP S"]:
    """Weights of a ridge regression of S numbers `rest`, each with its own prior."""
    square, product = near.T @ near, near.T @ rest
    weight = torch.zeros_like(product)
    for k, prior in enumerate(PRIOR):
        held = square + prior * torch.eye(len(square)).to(square)
        weight[:, k] = torch.linalg.solve(held, product[:, k])
    return weight


def held_out_answers(
    near: Float[Tensor, "C RP"], rest: Float[Tensor, "C S"]
) -> Float[Tensor, "C S"]:
    """Answers of the ridge regression for each fold of the frames, fitted on the other folds."""
    fold = torch.arange(len(near), device=near.device) * FOLDS // len(near)
    answers = torch.zeros_like(rest)
    for k in range(FOLDS):
        own = fold == k
        if own.any() and not own.all():
            answers[own] = near[own] @ ridge(near[~own], rest[~own])
    return answers


def standardising(
    answer: Float[Tensor, "C L"], share: Float[Tensor, " C"], closed: Float[Tensor, " L"]
) -> tuple[Float[Tensor, " L"], Float[Tensor, " L"]]:
    """Scale and shift of answers so that lips with closures have mean 0 and variance 1.

    Closed lips count in both and do not change, so the solution is found iteratively.
    """
    scale, shift = torch.ones(LIP_MEASURES).to(answer), torch.zeros(LIP_MEASURES).to(answer)
    for _ in range(ROUNDS):
        lips = with_closures(answer * scale + shift, share, closed)
        scale = scale * (1 / lips.std(0).clamp_min(1e-3)).clamp(0.5, 2)
        shift = shift - lips.mean(0)
    return scale, shift
