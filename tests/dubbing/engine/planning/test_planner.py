"""The work of a run, before it starts; and how jobs name and place their stages."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.engine.errors import ExplainedError
from dubbing.engine.graph.part import Part
from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.planning import planner
from dubbing.engine.planning.planner import AFTER, BLOCKED, RUN, UP_TO_DATE
from dubbing.engine.running import runner
from tests.dubbing.engine.listener import Listener
from tests.dubbing.engine.small_graph import (
    PARTS,
    Finetune,
    Prepare,
    Render,
    jobs_of,
    write_manifest,
)


def states(path: Path, *force: str) -> dict[str, str]:
    rows = planner.rows(jobs_of(path), force)
    return {f"{row.job.name} {row.name}": row.state for row in rows}


def test_a_stage_runs_for_a_reason_or_after_one_that_runs(tmp_path: Path) -> None:
    path = write_manifest(tmp_path, ["ann"], {"it": "ann"})
    assert {*states(path).values()} == {RUN}
    jobs = jobs_of(path)
    runner.run(jobs, runner.Options(), Listener())
    assert {*states(path).values()} == {UP_TO_DATE}
    assert states(path, "prepare") == {
        "ann prepare": RUN,
        "ann check_source": UP_TO_DATE,
        "ann finetune": AFTER,
        "it listen": UP_TO_DATE,
        "it render": AFTER,
    }
    rows = planner.rows(jobs, ("finetune",))
    assert [row.reasons for row in rows if row.state != UP_TO_DATE] == [
        ("forced",),
        ("if finetune gives another result",),
    ]
    assert planner.to_do(rows) == {StageId("identity/ann", "finetune"), StageId("dub/it", "render")}


def test_a_job_that_cannot_be_done_blocks_those_that_wait_for_it(tmp_path: Path) -> None:
    jobs = jobs_of(write_manifest(tmp_path, ["ann", "bob"], {"it": "ann", "de": "bob"}))
    jobs.by_label["identity/ann"].blocked = ExplainedError("is damaged", "ann.mp4")
    rows = planner.rows(jobs)
    blocked = [(row.job.label, row.name, row.reasons) for row in rows if row.state == BLOCKED]
    assert blocked == [
        ("identity/ann", "all", ("is damaged (ann.mp4)",)),
        ("dub/it", "all", ("is damaged (ann.mp4)",)),
    ]
    assert {name.job for name in planner.to_do(rows)} == {"identity/bob", "dub/de"}


def test_a_job_names_and_places_its_stages(tmp_path: Path) -> None:
    jobs = jobs_of(write_manifest(tmp_path, ["ann", "bob"], {"it": "ann bob"}, PARTS))
    out, scene = tmp_path / "out", jobs.by_label["dub/it"]
    prepare = jobs.by_label["identity/ann"].stage(Prepare)
    assert (str(prepare.id), prepare.folder) == (
        "identity/ann/prepare",
        out / "identities" / "ann" / "prepare",
    )
    render = scene.stage(Render, "bob")
    assert str(render.id) == "dub/it/render bob"
    assert render.folder == out / "dubs" / "it" / "cues" / "bob" / "render"
    assert [stage.id.of for stage in scene.all_of(Render)] == ["ann", "bob"]
    assert scene.find(render.id) == render
    part = scene.find(StageId("dub/it", "render", "bob", PARTS[0]))
    assert isinstance(part, Part)
    assert str(part.id) == "dub/it/render bob 0-1"
    assert (part.whole, part.id.whole, part.key()) == (render, render.id, render.key())
    assert part.folder.parent == render.folder.parent != part.folder
    for name in (StageId("dub/it", "render", "bob", "no such part"), StageId("dub/it", "finetune")):
        with pytest.raises(KeyError):
            scene.find(name)
    with pytest.raises(KeyError):
        scene.stage(Finetune)
    assert [*jobs.named("identity")] == ["ann", "bob"]
