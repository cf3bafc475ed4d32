"""Answers to a blind page: which versions people prefer, and how far they agree."""

from collections.abc import Iterable, Iterator
from itertools import combinations
from math import sqrt
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field
from typing_extensions import TypedDict

from dubbing.engine.disk import json_records
from dubbing.errors import CallError, ExplainedError
from dubbing.rating.pairs import Key, Pair

FIRST = {"first": 1.0, "same": 0.5, "second": 0.0}  # how much of an answer is for the first
NORMAL_95 = 1.96


class File(TypedDict):
    """Answers of one person, by pair, as the page saves them."""

    dfrf_answers: Literal[1]
    page: str
    person: Annotated[str, Field(min_length=1, max_length=100)]
    answers: dict[str, Literal["first", "second", "same"]]


class Answer(NamedTuple):
    """How much a person prefers the first of a pair: 1, 0, or 0.5 where there is no difference."""

    person: str
    pair: Pair
    first: float


class Share(NamedTuple):
    """A share of answers, of which some count half."""

    counted: float
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of a binomial share (Wilson, 1927)."""
        share, z2 = self.counted / self.of, NORMAL_95**2 / self.of
        half = NORMAL_95 * sqrt(share * (1 - share) / self.of + z2 / self.of / 4)
        return (share + z2 / 2 - half) / (1 + z2), (share + z2 / 2 + half) / (1 + z2)

    def __str__(self) -> str:
        if not self.of:
            return "no answers tell"
        low, high = (f"{100 * end:.0f}" for end in self.interval)
        return f"{100 * self.counted / self.of:.0f} % ({low} to {high} %) of {self.of}"


def read(paths: Iterable[Path], key: Key) -> list[Answer]:
    """The answers in files of a page.

    Raises:
        CallError: they are of another page, or two files are of one person.
        ExplainedError: a file holds something else, or nothing.
    """
    pairs = {pair["id"]: pair for pair in key["pairs"]}
    answers: list[Answer] = []
    for path in paths:
        found = json_records.read(path, File, "a file of answers", "save it from the page again")
        if found["page"] != key["page"]:
            remedy = "give the folder of that page, or answers of this one"
            raise CallError("these are the answers of another page", str(path), remedy)
        if any(answer.person == found["person"] for answer in answers):
            what = f"a second file of {found['person']!r}"
            raise CallError(what, str(path), "give the newer one alone")
        if unknown := next((one for one in found["answers"] if one not in pairs), ""):
            what = f"it answers a pair that the page does not have: {unknown!r:.100}"
            raise ExplainedError(what, str(path), "save it from the page again")
        if not found["answers"]:
            raise ExplainedError("it holds no answers", str(path), "leave it out")
        answers += [
            Answer(found["person"], pairs[one], FIRST[word])
            for one, word in found["answers"].items()
        ]
    return answers


def preferences(answers: list[Answer]) -> Iterator[tuple[int, int, Share]]:
    """Of each two versions, how often the one is preferred to the other."""
    by_versions: dict[tuple[int, int], list[float]] = {}
    for _, pair, first in answers:
        one, other = pair["first"]["version"], pair["second"]["version"]
        ordered = (min(one, other), max(one, other))
        by_versions.setdefault(ordered, []).append(first if one < other else 1 - first)
    for (one, other), some in sorted(by_versions.items()):
        yield one, other, Share(sum(some), len(some))


def among_people(answers: list[Answer]) -> Share:
    """How often two people say the same of one pair; "no difference" beside a choice is half."""
    by_pair: dict[str, list[float]] = {}
    for _, pair, first in answers:
        by_pair.setdefault(pair["id"], []).append(first)
    alike = [1 - abs(a - b) for some in by_pair.values() for a, b in combinations(some, 2)]
    return Share(sum(alike), len(alike))


def with_closeness(answers: list[Answer]) -> Share:
    """How often the dub of greater closeness is preferred."""
    nearer = [
        (first, one - other)
        for _, pair, first in answers
        if (one := pair["first"]["closeness"]) is not None
        and (other := pair["second"]["closeness"]) is not None
    ]
    return agreement(nearer)


def agreement(predicted: Iterable[tuple[float, float]]) -> Share:
    """How often the sign of a number foretells an answer; 0 foretells nothing, and is half."""
    alike = [0.5 if not sign else first if sign > 0 else 1 - first for first, sign in predicted]
    return Share(sum(alike), len(alike))
