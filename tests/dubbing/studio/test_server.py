"""The server of the page: what it serves, and what it saves."""

from __future__ import annotations

import asyncio
import gc
import json
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient

from dfrf.field.audio import NEIGHBOURS
from dfrf.field.speaker_adaptation import CONTEXT_FRAMES
from dubbing.engine import forks
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.manifest import load
from dubbing.script.edit import Edit
from dubbing.studio.making import Making, lines, run
from dubbing.studio.project import REACH, Project
from dubbing.studio.server import Server
from tests import clips
from tests.dubbing.studio.stand_in import DUB, FIRST, FRAMES, TOKEN, client_of, image

pytestmark = pytest.mark.medium


def save(client: TestClient, edit: Any, revision: str | None = None, line: str = FIRST) -> Any:
    own = client.get(DUB).json()["revision"] if revision is None else revision
    return client.put(f"{DUB}/lines/{line}", content=json.dumps({"revision": own, "edit": edit}))


def frames(client: TestClient, **wanted: Any) -> dict[int, tuple[str, bytes]]:
    asked = {"kind": "draft", "first": 0, "stop": FRAMES, "at": 0, **wanted}
    answer = client.post(f"{DUB}/frames", json=asked)
    assert answer.status_code == 200, answer.text
    found, rest = {}, answer.content
    while rest:
        head, body = (int.from_bytes(rest[k : k + 4], "big") for k in (0, 4))
        about = json.loads(rest[8 : 8 + head])
        assert "error" not in about, about
        found[about["frame"]] = about["mark"], rest[8 + head : 8 + head + body]
        rest = rest[8 + head + body :]
    assert answer.headers["x-frames"] == str(len(found))
    return found


def test_an_edit_is_saved_beside_the_manifest_and_read_by_it(
    client: TestClient, manifest: Path
) -> None:
    before = manifest.read_bytes()
    keys = [{"at": 0.2, "strength": 0}]
    answer = save(client, {"shift": 40, "keys": keys, "note": "shut", "status": "redo"})
    assert answer.status_code == 200, answer.text
    (first, _) = load(manifest).dubs["it"].cues
    assert first.edit == Edit(40, 1, "shut", ((0.2, 0),), "redo")
    own = edits_file(manifest, "it")
    once = own.read_bytes()
    assert save(client, answer.json()["lines"][0]["edit"]).json()["revision"]
    assert own.read_bytes() == once
    assert manifest.read_bytes() == before
    assert save(client, {"strength": 0.5}, line="ann_0000040-0000055").status_code == 200
    assert [cue.edit.strength for cue in load(manifest).dubs["it"].cues] == [1, 0.5]
    save(client, {})
    save(client, {}, line="ann_0000040-0000055")
    assert not own.exists()


def test_curves_stay_until_they_are_taken_away(client: TestClient, manifest: Path) -> None:
    (manifest.parent / "lips.csv").write_text("time,opening\n0.1,0.2\n")
    own = edits_file(manifest, "it")
    own.write_text("{line: 1, curves: lips.csv}")
    edit = client.get(DUB).json()["lines"][0]["edit"]
    assert save(client, {**edit, "strength": 0.5}).status_code == 200
    assert own.read_text().endswith("{line: 1, strength: 0.5, curves: lips.csv}\n")
    before = frames(client, first=5, stop=6)
    (manifest.parent / "lips.csv").write_text("time,opening\n0.1,0.3\n")
    have = {"5": before[5][0]}
    assert [*frames(client, first=5, stop=6, have=have)] == [5]  # drawn again
    save(client, {**edit, "curves": None})
    assert not own.exists()


def test_the_finished_dub_is_shown_in_the_size_of_its_draft(
    client: TestClient, manifest: Path
) -> None:
    clips.write_video(manifest.parent / "out" / "it.mp4", FRAMES)
    assert client.get(DUB).json()["dubbed"]
    shown = frames(client, kind="dub", first=20, stop=23)
    for k, (_, data) in shown.items():
        small = cv2.resize(clips.frame(k), (32, 24), interpolation=cv2.INTER_AREA)
        assert np.abs(image(data).astype(int) - small).mean() < 8
    assert [*shown] == [20, 21, 22]


def test_what_is_out_of_date_is_named_once(manifest: Path) -> None:
    assert Project(load(manifest)).stale() == []
    clips.write_sound(manifest.parent / "track.wav", FRAMES / 25, hertz=700)
    assert Project(load(manifest)).stale() == ["it: listen, 2 times"]
    for record in (manifest.parent / "out" / "work").rglob("*listen*/**/stage.json"):
        record.unlink()
    assert Project(load(manifest)).stale() == []  # the page listens to them


def test_a_stale_save_is_refused(client: TestClient, manifest: Path) -> None:
    old = client.get(DUB).json()["revision"]
    save(client, {"shift": 40}, old)
    answer = save(client, {"shift": 80}, old)
    assert answer.status_code == 409
    assert answer.json()["error"].startswith("saved elsewhere in the meantime")
    edits_file(manifest, "it").write_text("{line: 1, strength: 0}")  # by hand
    assert save(client, {"shift": 80}, old).status_code == 409
    assert client.get(DUB).json()["lines"][0]["edit"]["strength"] == 0


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        ({"shift": 501}, "shift: must be less than or equal to 500, not 501"),
        ({"shfit": 3}, "shfit: unknown key; did you mean 'shift'?"),
        ({"keys": [{"at": 0.7, "strength": 0}]}, "keys[0].at: the sound of line 1 ends after 0.60"),
        ({"keys": [{"at": 0.2}]}, "keys[0].strength: is required"),
        ({"status": "done"}, "status: must be one of 'open'"),
        ({"note": "x" * 1001}, "note: "),
        ({"note": "\ud800"}, "note: "),
        ({"curves": "/etc/passwd"}, "curves: only those in the file stay"),
        ({"line": 3}, "an edit is an object without line and speaker"),
        ([], "an edit is an object"),
    ],
)
def test_bad_edits_are_refused_with_a_sentence(client: TestClient, edit: Any, words: str) -> None:
    answer = save(client, edit)
    assert answer.status_code == 422
    assert answer.json()["error"].startswith(words), answer.text
    assert client.get(DUB).json()["lines"][0]["edit"] == client.get(DUB).json()["lines"][1]["edit"]


def test_bad_requests_are_refused_with_a_sentence(client: TestClient) -> None:
    line = f"{DUB}/lines/{FIRST}"
    big = "x" * 200_000
    for answer, code in (
        (client.put(line, content="{"), 400),
        (client.put(line, json=[]), 400),
        (client.put(line, content="[" * 50_000), 400),
        (client.put(line, json={"edit": {}}), 400),
        (client.put(f"{DUB}/lines/nobody", json={"revision": "", "edit": {}}), 404),
        (client.put(line, json={"revision": big, "edit": {}}), 413),
        (client.post(f"{DUB}/frames", json={"kind": "draft"}), 400),
        (client.post(f"{DUB}/frames", json={"kind": "x", "first": 0, "stop": 9, "at": 0}), 400),
        (client.post(f"{DUB}/frames", json={"kind": "dub", "first": 0, "stop": 9, "at": 0}), 404),
        (
            client.post(f"{DUB}/frames", json={"kind": "draft", "first": 0, "stop": 99, "at": 0}),
            400,
        ),
        (client.delete(DUB), 405),
    ):
        assert (answer.status_code, bool(answer.text)) == (code, True), answer.text


def test_a_file_that_was_spoilt_by_hand_is_named(client: TestClient, manifest: Path) -> None:
    edits_file(manifest, "it").write_text("- line: 9\n")
    answer = client.get(DUB)
    assert answer.status_code == 422
    assert "nobody dubs a line 9" in answer.json()["error"]
    edits_file(manifest, "it").write_text("{")
    assert "it.edits.yaml" in client.get(DUB).json()["error"]


def test_edits_in_the_manifest_are_shown_and_left_alone(manifest: Path) -> None:
    text = manifest.read_text().replace("track.wav}", "track.wav, edits: {line: 3, shift: 80}}")
    manifest.write_text(text)
    with client_of(manifest) as client:
        client.get(f"/?token={TOKEN}")
        dub = client.get(DUB).json()
        assert dub["fixed"]
        assert [line["edit"]["shift"] for line in dub["lines"]] == [0, 80]
        answer = save(client, {"shift": 40})
        assert answer.status_code == 422
        assert "move them to it.edits.yaml beside it" in answer.json()["error"]


def test_curves_and_sound(client: TestClient) -> None:
    curves = client.get(f"{DUB}/curves").json()
    assert {*curves["lines"]} == {FIRST, "ann_0000040-0000055"}
    assert len(curves["peaks"]) == pytest.approx(100 * FRAMES / 25, abs=3)
    sound = client.get(f"{DUB}/sound", headers={"range": "bytes=0-3"})
    assert (sound.status_code, sound.content) == (206, b"fLaC")


def test_a_take_with_another_recording_is_heard_and_drafted(manifest: Path) -> None:
    """A part of the studio's work alone is done anew: that of the line."""
    clips.write_sound(manifest.parent / "again.wav", 0.6, hertz=900)
    takes = "takes: {again: {audio: again.wav}}"
    edits_file(manifest, "it").write_text(f"{{line: 1, {takes}}}")
    with client_of(manifest) as client:
        client.get(f"/?token={TOKEN}")

        def chosen(take: str) -> tuple[Any, bytes, list[str]]:
            (version, _) = client.get(DUB).json()["lines"]
            edit = {"takes": version["takes"], "take": take, **version["takes"][take]}
            assert save(client, edit).status_code == 200
            dub = client.get(DUB).json()
            assert dub["lines"][0]["edit"]["take"] == take
            client.get(f"{DUB}/curves")
            marks = [mark for _, (mark, _) in sorted(frames(client).items())]
            return dub["heard"], client.get(f"{DUB}/sound").content, marks

        before, again, after = chosen(""), chosen("again"), chosen("")
        assert before == after
        assert before[0] != again[0]
        assert before[1] != again[1]
        changed = [k for k, (a, b) in enumerate(zip(before[2], again[2], strict=True)) if a != b]
        assert changed == [*range(5, 20)]
        # No page may have other files read.
        (line, _) = client.get(DUB).json()["lines"]
        other = {"takes": {**line["takes"], "x": {"audio": str(manifest)}}}
        assert "audio: only those in the file" in save(client, other).json()["error"]
        assert line["takes"]["again"]["audio"].endswith("again.wav")


def test_only_changed_frames_are_drawn_the_shown_one_first(client: TestClient) -> None:
    before = frames(client, at=10)
    assert [*before] == [*range(10, FRAMES), *range(10)]
    have = {str(k): mark for k, (mark, _) in before.items()}
    assert frames(client, have=have) == {}
    save(client, {"keys": [{"at": 0.3, "strength": 0}]})
    after = frames(client, have=have, at=12)
    # The key lies in the middle of frame 5 + 7; it reaches less than 3 frames to both sides.
    assert sorted(after) == [10, 11, 12, 13, 14]
    assert next(iter(after)) == 12
    middle = [image(found[12][1]).astype(float) for found in (before, after)]
    assert np.abs(middle[0] - middle[1]).max() > 30
    save(client, {})
    assert frames(client, have=have) == {}
    film = frames(client, kind="film")
    assert image(film[0][1]).shape == image(before[0][1]).shape == (24, 32, 3)
    # Beside the lines the draft is the film.
    assert np.abs(image(film[30][1]).astype(float) - image(before[30][1])).max() < 3


def test_a_moved_part_is_drawn_again_as_far_as_its_speech_reaches(client: TestClient) -> None:
    assert REACH >= NEIGHBOURS // 2 + CONTEXT_FRAMES
    before = frames(client)
    have = {str(k): mark for k, (mark, _) in before.items()}
    save(client, {"moved": [{"start": 0.56, "end": 0.6, "shift": 20}]})
    # From twice its shift before it on, to the end of the line.
    assert sorted(frames(client, have=have)) == [*range(5 + 13 - REACH, 20)]
    save(client, {"moved": [{"start": 0, "end": 9, "shift": 20}]})
    assert sorted(frames(client, have=have)) == [*range(5, 20)]


def test_a_process_that_ends_is_told_of_and_starts_again(manifest: Path) -> None:
    with client_of(manifest) as client:
        client.get(f"/?token={TOKEN}")
        assert frames(client)
        drafter = client.app.state.drafter  # type: ignore[attr-defined]
        drafter._process.kill()
        drafter._process.join()
        assert frames(client)


def test_a_run_is_watched_and_stopped(client: TestClient, manifest: Path) -> None:
    def state() -> Any:
        return client.get(f"{DUB}/revision").json()["making"]

    def make(run: object) -> Any:
        return client.put(f"{DUB}/making", json={"run": run})

    def ended() -> str:
        while state()["running"]:
            time.sleep(0.05)
        return str(state()["words"])

    assert state() == {"dub": "", "running": False, "words": ""}
    assert make("x").status_code == 400
    assert make(False).json()["running"] is False  # there is none
    assert make(True).json()["running"] is True
    again = make(True)
    assert (again.status_code, "it is being made" in again.json()["error"]) == (422, True)
    assert make(False).status_code == 200
    assert ended() == "stopped; it goes on where it was"
    assert not (manifest.parent / "out" / "it.mp4").exists()
    make(True)
    assert ended() == "made"
    assert (manifest.parent / "out" / "it.mp4").exists()
    (manifest.parent / "track.wav").write_bytes(b"damaged")
    make(True)
    assert ended().startswith("not made: ")


def test_the_words_of_a_run_name_the_stage_that_runs(manifest: Path) -> None:
    making, said = Making(manifest, "auto"), []
    render, composite = {"stage": "render ann_0000005-0000020"}, {"stage": "composite"}

    def printed() -> Iterator[str]:
        for event, about in (
            ("overall", {"done": 7, "total": 10}),
            ("begin", render),
            ("progress", {**render, "share": 0.89}),
            ("overall", {"done": 8, "total": 10}),
            ("begin", composite),
        ):
            yield json.dumps({"event": event, **about})
            said.append(making.state()["words"])

    making._process = process = SimpleNamespace(join=lambda: None, exitcode=0)
    making._watch(printed(), process)
    assert said[1:3] == ["7 of 10 stages, render 0%", "7 of 10 stages, render 89%"]
    assert said[-1] == "8 of 10 stages, composite 0%"
    assert making.state() == {"dub": "", "running": False, "words": "made"}


def test_all_that_a_run_prints_arrives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "printing.py").write_text("""
import sys, typer
def main():
    typer.echo("öffnet, " + " ".join(sys.argv))
    print("zwei", end="")
    typer.echo(" Žižek", err=True)
    sys.exit(3)
""")
    monkeypatch.syspath_prepend(tmp_path)
    pipe, other = forks.CONTEXT.Pipe(duplex=False)
    running = forks.process(run, "printing", ["dub"], other)
    running.start()
    other.close()
    assert [*lines(pipe)] == ["öffnet, dfrf dub", "zwei Žižek", ""]
    running.join()
    assert running.exitcode == 3


def test_a_run_that_is_stopped_while_it_begins_is_stopped(
    manifest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "beginning.py").write_text("def main():\n    raise KeyboardInterrupt\n")
    monkeypatch.syspath_prepend(tmp_path)
    making = Making(manifest, "cpu", "beginning")
    making.start("it")
    while making.state()["running"]:
        time.sleep(0.05)
    assert making.state()["words"] == "stopped; it goes on where it was"


def test_curves_that_fail_for_somebody_who_left_are_no_complaint() -> None:
    said: list[object] = []

    async def fail(*_: object) -> dict[str, Any]:
        await asyncio.sleep(0)
        raise ExplainedError("the process ended")

    async def leave() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, about: said.append(about))
        server: Any = object.__new__(Server)
        server.curves_of, server._ask_curves = {}, fail
        server.project = SimpleNamespace(edits=lambda _: {}, heard=lambda _: "heard")
        asked = asyncio.create_task(server._curves("it"))
        while not server.curves_of:
            await asyncio.sleep(0)
        asked.cancel()
        await asyncio.wait([asked, *server.curves_of.values()])
        server.curves_of.clear()
        gc.collect()

    asyncio.run(leave())
    gc.collect()
    assert not said
