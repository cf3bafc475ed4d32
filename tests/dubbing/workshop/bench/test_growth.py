"""How a dub's time grows: what is made for each row of the table, not how long it takes."""

import json
from pathlib import Path

import pytest

from dubbing.workshop.bench import growth


def test_one_thing_is_varied_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[dict[str, object], tuple[str, ...]]] = []

    def stand_in(path: Path, plan: dict[str, object], *options: str) -> float:
        calls.append((json.loads(json.dumps(plan)), options))
        return float(len(calls))

    monkeypatch.setattr(growth, "dubbed", stand_in)
    rows = growth.growth(Path("clip.mp4"), Path("it.wav"), tmp_path / "out")
    assert [list(row.seconds) for row in rows] == [[1, 2, 3], [4, 5, 6], [2, 7], [7, 8]]
    plans = [plan for plan, _ in calls]
    sizes = [{p["size"] for p in plan["identities"].values()} for plan in plans]  # type: ignore[attr-defined]
    assert sizes == [{128}, {256}, {512}, *[{256}] * 5]
    # A second dub is of the person that was learned, in the same folder, and each is a new one.
    assert [plan["output"] for plan in plans[3:6]] == [plans[1]["output"]] * 3
    names = [[dub["name"] for dub in plan["dubs"]] for plan in plans]  # type: ignore[attr-defined]
    assert names[3:6] == [names[5][:1], names[5][:2], names[5]]
    assert not set(names[5]) & set(names[1])
    assert [len(plan["identities"]) for plan in plans[6:]] == [2, 2]  # type: ignore[arg-type]
    assert [options for _, options in calls] == [*[()] * 7, ("--jobs", "2")]
    assert growth.table(rows).splitlines()[2] == (
        "| head crop, px: a first dub | 128, 256, 512 | 1.0, 2.0, 3.0 |"
    )
