"""Seconds that are left: from what is expected, corrected by what is measured, without leaps."""

from __future__ import annotations

from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.planning.time_left import TimeLeft

# A first dub of 10 s, as a machine of two cores takes: seconds by stage.
EXPECTED = {
    StageId("identity/ann", "prepare"): 29.0,
    StageId("identity/ann", "finetune"): 357.0,
    StageId("identity/ann", "refine_poses"): 24.0,
    StageId("dub/it", "render"): 81.0,
    StageId("dub/it", "composite"): 10.0,
    StageId("dub/it", "check"): 3.0,
}


class Run:
    """A run whose stages take so many times what was expected."""

    def __init__(self, expected: dict[StageId, float], slower: float) -> None:
        self.now = 0.0
        self.left = TimeLeft(expected, lambda: self.now)
        self.shown: list[tuple[float, float]] = []
        self.total = sum(expected.values()) * slower
        for key, seconds in expected.items():
            self.left.begin(key)
            for step in range(1, 101):
                self.now += seconds * slower / 100
                self.left.progress(key, step / 100)
                if (left := self.left.all()) is not None:
                    self.shown.append((self.now, left))
            self.left.end(key)


def test_a_run_that_goes_as_expected_counts_down() -> None:
    run = Run(EXPECTED, 1.0)
    assert all(abs(run.total - now - left) < 2 for now, left in run.shown)


def test_a_machine_that_is_three_times_slower_is_seen_and_nothing_leaps() -> None:
    run = Run(EXPECTED, 3.0)
    assert run.shown[0][1] < 600  # as expected
    late = [(now, left) for now, left in run.shown if now > 100]
    assert all(0.8 < (run.total - now + 1) / (left + 1) < 1.25 for now, left in late)
    rises = [b - a for (_, a), (_, b) in zip(run.shown, run.shown[1:], strict=False)]
    steps = [b - a for (a, _), (b, _) in zip(run.shown, run.shown[1:], strict=False)]
    assert all(rise < 60 * step for rise, step in zip(rises, steps, strict=True))


def test_a_quick_machine_is_seen() -> None:
    run = Run(EXPECTED, 0.3)
    late = [(now, left) for now, left in run.shown if now > 30]
    assert all(abs(run.total - now - left) < 15 for now, left in late)


def test_stages_side_by_side_share_the_time_but_the_longest_one_stays() -> None:
    now = 0.0
    long, short = StageId("a/x", "render"), StageId("b/y", "render")
    left = TimeLeft({long: 100.0, short: 10.0}, lambda: now, workers=2)
    left.begin(long)
    left.begin(short)
    assert left.all() == 100.0


def test_what_nobody_knows_is_not_shown() -> None:
    now = 0.0
    left = TimeLeft({}, lambda: now)
    render = StageId("a/x", "render")
    left.begin(render)
    assert left.of(render) is None
    assert left.all() is None
    now = 30.0
    left.progress(render, 0.5)
    assert left.of(render) == 30.0  # by its own speed
    left.end(render)
    left.end(StageId("a/x", "unheard_of"))
