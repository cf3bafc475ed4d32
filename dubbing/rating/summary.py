"""The answers of all people to a page, in words."""

from collections.abc import Iterator
from pathlib import Path

import dubbing
from dubbing.rating import answers as told
from dubbing.rating import fitting
from dubbing.rating.answers import Answer, agreement
from dubbing.rating.pairs import Key
from dubbing.sync import closeness


def in_words(answers: list[Answer], key: Key) -> Iterator[str]:
    """Lines: what is preferred, how far people agree, and weights of closeness fitted to that."""
    people = ", ".join(dict.fromkeys(answer.person for answer in answers))
    pairs = len({answer.pair["id"] for answer in answers})
    yield f"{len(answers)} answers about {pairs} of {len(key['pairs'])} pairs, by {people}"
    yield "shares with their 95 % interval; no difference counts half"
    for one, other, share in told.preferences(answers):
        yield f"  {key['versions'][one]} preferred to {key['versions'][other]}: {share}"
    yield f"  two people say the same: {told.among_people(answers)}"
    yield f"  the greater closeness is preferred: {told.with_closeness(answers)}"
    differing, first, dubs = fitting.differences(answers)
    if not len(first):
        yield "no weights can be fitted: no pair has closeness on both sides"
        return
    today = closeness.WEIGHTS
    before = agreement(zip(first, differing @ [*today.values()], strict=True))
    yield f"  today's weights foretell the answer: {before}"
    yield f"  weights fitted to the other dubs do: {fitting.left_out(differing, first, dubs)}"
    yield f"weights fitted to all, pulled towards today's as by {fitting.PRIOR_ANSWERS} answers:"
    for (part, now), new in zip(today.items(), fitting.fitted(differing, first), strict=True):
        yield f"  {part:10} {now:.3f} -> {new:.3f}"
    place = Path(closeness.__file__).relative_to(Path(dubbing.__file__).parents[1]).as_posix()
    yield f"no option takes them: they belong into WEIGHTS in {place}"
