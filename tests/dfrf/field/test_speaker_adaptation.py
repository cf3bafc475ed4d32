"""A person's lips, from the predicted lips of people in general."""

import pytest
import torch
from torch import Tensor

from dfrf.field.speaker_adaptation import (
    CONTEXT_FRAMES,
    LIP_MEASURES,
    NUMBERS,
    OPENING,
    PREDICTED,
    TOUCHING,
    SpeakerAdaptation,
    closed_mouth,
    extended,
    held_out_answers,
    ridge,
    rows_of_neighbours,
    smoothed,
    with_closures,
)


def closures(adaptation: SpeakerAdaptation, predicted: Tensor, opening: Tensor) -> Tensor:
    """How far lips touch, (F,) in 0..1, from predictions (F + 2R, P) and openings (F,)."""
    of_score, of_opening, offset = adaptation.score
    answer = adaptation.linear(rows_of_neighbours(predicted))
    score = of_score * smoothed(answer[:, TOUCHING]) + of_opening * opening + offset
    return score.sigmoid()


def lips_of(adaptation: SpeakerAdaptation, predicted: Tensor, closed: Tensor) -> Tensor:
    """The person's lips (C, L) in all frames of predictions, closures included."""
    lips, share = adaptation(extended(predicted))
    return with_closures(lips, share, closed)


def smooth(frames: int, columns: int, seed: int) -> Tensor:
    """Numbers (C, columns) that change over a few frames."""
    noise = torch.randn(frames + 8, columns, generator=torch.Generator().manual_seed(seed))
    made = noise.unfold(0, 9, 1).mean(-1)
    return (made - made.mean(0)) / made.std(0)


def talking(frames: int = 600, seed: int = 0) -> tuple[Tensor, Tensor, Tensor]:
    """Predictions (C, P), the lips (C, K) of somebody who is late and mixes measures, touching."""
    predicted = smooth(frames, NUMBERS, seed)
    predicted[:, TOUCHING] = -predicted[:, 0] + 0.3 * predicted[:, TOUCHING]
    mixing = torch.eye(LIP_MEASURES) + 0.5 * torch.randn(
        LIP_MEASURES, LIP_MEASURES, generator=torch.Generator().manual_seed(3)
    )
    lips = predicted[:, :LIP_MEASURES].roll(2, 0) @ mixing
    lips = (lips - lips.mean(0)) / lips.std(0)
    touching = (lips[:, 0] < lips[:, 0].quantile(0.2)).float()
    return predicted, lips, touching


def agreement(one: Tensor, other: Tensor) -> Tensor:
    """Correlation of each column."""
    a, b = one - one.mean(0), other - other.mean(0)
    return (a * b).sum(0) / (a.norm(dim=0) * b.norm(dim=0))


def learned(count: int = 400) -> tuple[SpeakerAdaptation, Tensor, Tensor, Tensor]:
    """An adaptation learned from the first frames of somebody, and all there is of them."""
    predicted, lips, touching = talking()
    adaptation = SpeakerAdaptation()
    adaptation.fit(predicted[:count], lips[:count], touching[:count])
    return adaptation, predicted, lips, touching


def test_the_ends_of_a_row_go_on() -> None:
    predicted = torch.arange(10.0).view(5, 2)
    made = extended(predicted)
    assert made.shape == (5 + 2 * CONTEXT_FRAMES, 2)
    assert torch.equal(made[:CONTEXT_FRAMES], predicted[:1].expand(CONTEXT_FRAMES, -1))
    assert torch.equal(made[-CONTEXT_FRAMES:], predicted[-1:].expand(CONTEXT_FRAMES, -1))


def test_without_an_adaptation_lips_do_what_is_predicted() -> None:
    predicted, _, _ = talking(50)
    made, share = SpeakerAdaptation()(extended(predicted))
    torch.testing.assert_close(made, predicted[:, :LIP_MEASURES])
    assert share.max() == 0


def test_a_person_who_is_late_and_mixes_measures_is_learned() -> None:
    adaptation, predicted, lips, _ = learned()
    made = lips_of(adaptation, predicted, closed_mouth(lips))[400:]
    before = agreement(predicted[400:, :LIP_MEASURES], lips[400:])
    after = agreement(made, lips[400:])
    assert (after > 0.4).all()
    assert after.mean() > before.mean() + 0.1


def test_lips_that_are_heard_and_not_predicted_are_learned() -> None:
    predicted, lips, touching = talking()
    lips[:, OPENING] = predicted[:, PREDICTED + 5]
    deaf = predicted.clone()
    deaf[:, PREDICTED:] = 0
    found = []
    for given in (predicted, deaf):
        adaptation = SpeakerAdaptation()
        adaptation.fit(given[:400], lips[:400], touching[:400])
        made = lips_of(adaptation, given, closed_mouth(lips))[400:]
        found.append(float(agreement(made, lips[400:])[OPENING]))
    assert found[0] > max(0.5, found[1] + 0.3)


def test_each_part_is_answered_by_what_the_others_taught() -> None:
    generator = torch.Generator().manual_seed(1)
    near = torch.randn(400, 300, generator=generator).double()
    rest = torch.randn(400, PREDICTED, generator=generator).double()
    made = held_out_answers(near, rest)
    torch.testing.assert_close(made[:100], near[:100] @ ridge(near[100:], rest[100:]))
    # Numbers that have nothing to do with what is heard are not answered, as they are by rote.
    assert agreement(made, rest).abs().max() < 0.2
    assert agreement(near @ ridge(near, rest), rest).min() > 0.5


def test_answers_have_the_mean_and_the_spread_of_the_person_s_lips() -> None:
    adaptation, predicted, lips, _ = learned(count=600)
    made = lips_of(adaptation, predicted, closed_mouth(lips))
    torch.testing.assert_close(made.mean(0), torch.zeros(LIP_MEASURES), atol=0.1, rtol=0)
    torch.testing.assert_close(made.std(0), torch.ones(LIP_MEASURES), atol=0.1, rtol=0.1)


def test_lips_touch_as_often_as_the_person_s_own_and_then_are_shut() -> None:
    adaptation, predicted, lips, touching = learned()
    _, share = adaptation(extended(predicted))
    assert abs(float((share[:400] > 0.5).float().mean()) - float(touching[:400].mean())) < 0.02
    shut = closed_mouth(lips[:400])
    made = lips_of(adaptation, predicted, shut)
    closed = share > 0.95
    assert closed.any()
    torch.testing.assert_close(made[closed, 0], shut[0].expand(int(closed.sum())), atol=0.2, rtol=0)


def test_somebody_whose_lips_never_touch_has_none_that_do() -> None:
    predicted, lips, _ = talking()
    adaptation = SpeakerAdaptation()
    adaptation.fit(predicted, lips, torch.zeros(len(predicted)))
    assert closures(adaptation, extended(predicted), torch.zeros(len(predicted))).max() < 1e-3


def test_lips_do_not_twitch_where_one_frame_s_score_does() -> None:
    adaptation, predicted, _, _ = learned()
    heard, _, offset = adaptation.score
    once = predicted[:1].repeat(30, 1)
    once[:, TOUCHING] = (-1 - offset) / heard
    once[15, TOUCHING] += 2 / heard
    share = closures(adaptation, extended(once), torch.zeros(30))
    assert (share[14:17] > share[0] + 0.02).all()
    assert share.diff().abs().max() < 0.2


def test_a_part_has_the_lips_of_the_whole() -> None:
    adaptation, predicted, _, _ = learned()
    whole = adaptation(extended(predicted))
    part = adaptation(predicted[100 - CONTEXT_FRAMES : 150 + CONTEXT_FRAMES])
    for some, every in zip(part, whole, strict=True):
        torch.testing.assert_close(some, every[100:150], atol=1e-5, rtol=1e-5)


def test_predictions_of_another_width_are_refused() -> None:
    with pytest.raises(RuntimeError):
        SpeakerAdaptation()(torch.zeros(20, NUMBERS - 1))
