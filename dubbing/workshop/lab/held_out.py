"""Which frames of a clip are tested: none that a person was learned from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from dubbing.errors import ExplainedError
from dubbing.identity.best_seconds import Part
from dubbing.production.person import Person

LONG_CLIP = 30.0  # seconds; a longer clip is tested on more of it


@dataclass(frozen=True)
class Tested:
    """Which frames of a clip are tested.

    Attributes:
        learned: frames that were learned from.
        p15: the part whose pictures are compared; None without this protocol.
        p15x: the parts whose speech is dubbed over other pictures; none without it and without
            `composition`.
    """

    learned: list[Part]
    p15: Part | None
    p15x: list[Part]


def supposed(person: Person) -> tuple[float, float]:
    """From which second to which they are learned; of the best only how many they are is known."""
    start = person.start or 0.0
    return start, start + person.seconds


def frames_to_test(
    person: Person,
    learned: Sequence[tuple[float, float]],
    seconds: float | None,
    protocols: tuple[str, ...],
) -> Tested:
    """Frames of a person's clip to test on, `seconds` of each protocol at most.

    Args:
        learned: from which second to which it was learned from.

    Raises:
        ExplainedError: the clip is damaged, or nothing of it is held out.
    """
    clip = person.clip.probed
    frames = [(round(a * clip.rate), round((b - a) * clip.rate)) for a, b in learned]
    others = unlearned(clip.frames, clip.rate, frames)
    if not others:
        raise ExplainedError(
            f"nothing of the clip is held out beside {person.seconds:g} s",
            person.name,
            "learn fewer seconds, or use a longer clip",
        )
    return Tested(
        frames,
        held_out(clip.frames, clip.rate, others, seconds) if "p15" in protocols else None,
        unlearned(clip.frames, clip.rate, frames, seconds) if {*protocols} - {"p15"} else [],
    )


def held_out(frames: int, rate: Fraction, parts: Sequence[Part], most: float | None = None) -> Part:
    """The part to test on: the last 5 s of what was not learned, or 10 s of a clip over 30 s.

    Where the last part is shorter, another that is as long, or the longest.

    Args:
        frames, rate: of the clip, frames a second.
        parts: that were not learned from, the last first, one at least.
        most: seconds; of a longer part, its beginning is taken.
    """
    wanted = round((10 if frames / rate > LONG_CLIP else 5) * rate)
    longest = max(parts, key=lambda part: part[1])
    first, count = next((part for part in parts if part[1] >= wanted), longest)
    length = min(count, wanted)
    tested = length if most is None else min(length, max(1, round(most * rate)))
    return first + count - length, tested


def unlearned(
    frames: int, rate: Fraction, learned: Sequence[Part], most: float | None = None
) -> list[Part]:
    """The parts of a clip that were not learned from, the last first.

    Args:
        frames, rate: of the clip, frames a second.
        learned: frames that were learned from, in their order.
        most: seconds of them together.
    """
    left = frames if most is None else max(1, round(most * rate))
    stops = [first for first, _ in learned] + [frames]
    starts = [0, *(min(sum(part), frames) for part in learned)]
    parts = []
    for start, stop in zip(reversed(starts), reversed(stops), strict=True):
        if (count := min(stop - start, left)) > 0:
            parts.append((start, count))
            left -= count
    return parts
