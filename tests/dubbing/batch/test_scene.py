"""A scene: a film, its lines, music under the voices; and what a changed line makes again."""

from __future__ import annotations

import csv
import json
import re
import shutil
from contextlib import closing
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.batch import jobs, task
from dubbing.engine.graph.graph import nodes
from dubbing.engine.running.processes import Processes
from dubbing.manifest.manifest import load
from dubbing.script.timecode import frame_of
from dubbing.stages.check import Check
from dubbing.video import assembly as composite
from dubbing.video import untouched
from tests import clips, fakes
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium


FPS = Fraction(24000, 1001)
FRAMES = 90
CONSENT = '{by: "a synthetic person", reference: "form 17"}'
SRT = """1
00:00:00,417 --> 00:00:00,834
ANN: Good evening.

2
00:00:01,000 --> 00:00:01,250
BEN: Nobody dubs him.

3
00:00:01,668 --> 00:00:02,085
ANN: It begins.

4
00:00:02,920 --> 00:00:03,420
ANN: And ends.
"""
CUES = ((10, 20), (40, 50), (70, 82))  # frames of Ann's lines


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    fakes.install(monkeypatch.setattr)
    monkeypatch.setattr(composite, "SEGMENT", 33)  # edges of segments lie in a cue and outside


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A manifest of one scene, with all that it names."""
    clips.write_clip(tmp_path / "film.mp4", FRAMES, FPS)
    (tmp_path / "it.srt").write_text(SRT)
    for number, seconds in ((1, 0.4), (3, 0.41), (4, 0.3)):
        clips.write_sound(tmp_path / f"ann_{number:02d}.wav", seconds, hertz=600 + number)
    at = np.arange(round(FRAMES / FPS * 48000)) / 48000
    music = 0.05 * np.sin(2 * np.pi * 97 * at)
    soundfile.write(tmp_path / "me.wav", np.stack([music, music], 1), 48000)
    path = tmp_path / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\nidentities:\n"
        f"  ann: {{clip: film.mp4, seconds: 1, consent: {CONSENT}}}\n"
        "dubs:\n"
        "  - {name: it, lines: it.srt, speakers: {ANN: ann}, audio: 'ann_{cue:02}.wav',\n"
        "     music_effects: me.wav, loudness: r128, mark: false, codec: ffv1}\n"
    )
    return path


def report_of(scene: Path) -> dict:
    return json.loads((scene.parent / "out" / "report.json").read_text())["dubs"]["it"]


def test_cues_are_dubbed_at_their_frames_and_the_film_is_left_alone(scene: Path) -> None:
    result, began = dub(scene)
    assert result.code == 0, result.outcomes
    assert began[:4] == ["ann:prepare", "ann:check_source", "ann:finetune", "ann:refine_poses"]
    assert began[4:] == ["it:listen"] * 3 + ["it:render"] * 3 + ["it:composite", "it:check"]
    made = np.stack([*media.read_frames(scene.parent / "out" / "it.mkv")])
    film = np.stack([*media.read_frames(scene.parent / "film.mp4")])
    assert made.shape == film.shape
    touched = (made != film).any((1, 2, 3))
    spoken = np.zeros(FRAMES, bool)
    for first, stop in CUES:
        spoken[first:stop] = True
    np.testing.assert_array_equal(touched, spoken)  # right times, to the frame
    # The head of a cue is its own, and it fades in and out.
    for first, stop in CUES:
        middle = (first + stop) // 2
        head = np.array([*fakes.HEAD[:2], middle - first])
        # In the film's values; chroma rings at the edges of so small a head.
        shown = made[middle, 18:22, 22:26].mean((0, 1))
        assert np.abs(shown - head).max() <= 2
        green = made[first : first + 5, 20, 24, 0].astype(int) - film[first, 20, 24, 0]
        assert (np.diff(np.abs(green))[:3] > 0).all()
    work = scene.parent / "out" / "work" / "dubs" / "it"
    found = json.loads((work / "composite" / "scene.json").read_text())
    assert found["untouched"]["identical"]
    assert found["untouched"]["frames"] == FRAMES - 32
    assert found["untouched"]["source"] == found["untouched"]["result"]
    for cue in found["sound"]["cues"]:
        assert cue["loudness"] == pytest.approx(-23, abs=0.5)


def test_what_is_handed_over(scene: Path) -> None:
    dub(scene)
    out = scene.parent / "out"
    rows = list(csv.DictReader((out / "it.lines.csv").read_text().splitlines()))
    assert [(row["line"], row["speaker"], row["words"]) for row in rows] == [
        ("1", "ANN", "Good evening."),
        ("3", "ANN", "It begins."),
        ("4", "ANN", "And ends."),
    ]
    assert [(int(row["in_frame"]), int(row["out_frame"])) for row in rows] == list(CUES)
    assert [row["in"] for row in rows] == ["00:00:00:10", "00:00:01:16", "00:00:02:22"]
    same = [json.loads(line) for line in (out / "it.lines.jsonl").read_text().splitlines()]
    assert [row["in"] for row in same] == [row["in"] for row in rows]
    assert all(abs(row["loudness"] + 23) < 0.5 for row in same)
    # The list of markers, read back.
    event = re.compile(r"^(\d{3})  001 +V +C +(\S+) (\S+) (\S+) (\S+)$", re.MULTILINE)
    events = event.findall((out / "it.edl").read_text())
    assert [number for number, *_ in events] == ["001", "002", "003"]
    times = [(frame_of(first, FPS), frame_of(stop, FPS)) for _, _, _, first, stop in events]
    assert times == list(CUES)
    locators = re.findall(
        r"^\* LOC: (\S+) (\w+) +(.*)$", (out / "it.edl").read_text(), re.MULTILINE
    )
    assert locators[1][0] == "00:00:01:16"
    assert "ANN" in locators[1][2]
    assert "It begins." in locators[1][2]
    page = (out / "report.html").read_text()
    assert '"video": "it.proxy.mp4"' in page
    assert f'"untouched": {{"frames": {FRAMES - 32}, "of": {FRAMES},' in page
    proxy = media.probe(out / "it.proxy.mp4")
    assert (proxy.frames, proxy.rate, proxy.width) == (FRAMES, FPS, 64)


def test_one_line_changed_is_one_line_made(scene: Path) -> None:
    dub(scene)
    clips.write_sound(scene.parent / "ann_03.wav", 0.38, hertz=500)
    _, began = dub(scene)
    # (The stand-in heads do not depend on what is said, so the sound alone is new.)
    assert began == ["it:listen", "it:render", "it:composite", "it:check"]
    # Moving a line renders that line; what it was before is gone.
    (scene.parent / "it.srt").write_text(SRT.replace("00:00:01,668", "00:00:01,585"))
    _, began = dub(scene)
    assert began == ["it:listen", "it:render", "it:composite", "it:check"]
    cues = scene.parent / "out" / "work" / "dubs" / "it" / "cues"
    assert sorted(p.name for p in cues.iterdir()) == [
        "ann_0000010-0000020",
        "ann_0000038-0000050",
        "ann_0000070-0000082",
    ]
    assert dub(scene)[1] == []
    # Louder or softer changes no head.
    scene.write_text(scene.read_text().replace("loudness: r128", "loudness: streaming"))
    assert dub(scene)[1] == ["it:composite", "it:check"]


def test_an_edit_of_a_line_is_named_in_what_is_handed_over(scene: Path) -> None:
    dub(scene)
    edit = ", edits: {line: 3, shift: -40, strength: 0.5, note: mumbled}}\n"
    scene.write_text(scene.read_text().replace("codec: ffv1}\n", f"codec: ffv1{edit}"))
    # (The stand-in heads do not depend on edits, so the video stays as it is.)
    assert dub(scene)[1] == ["it:render"]
    named = [(row["line"], row["edit"]) for row in report_of(scene)["lines"]]
    words = "the mouth 40 ms earlier, strength 0.5: mumbled"
    assert named == [(1, ""), (3, words), (4, "")]
    scene.write_text(scene.read_text().replace("mumbled", "softer"))
    assert dub(scene)[1] == []
    text = (scene.parent / "out" / "it.lines.csv").read_text()
    found = [(r["shift"], r["strength"], r["note"]) for r in csv.DictReader(text.splitlines())]
    assert found == [("", "", ""), ("-40.0", "0.5", "softer"), ("", "", "")]
    assert report_of(scene)["lines"][1]["edit"].endswith(": softer")


def test_takes_stay_with_their_figures(scene: Path) -> None:
    clips.write_sound(scene.parent / "again.wav", 0.4, hertz=900)
    takes = "{again: {audio: again.wav}, late: {shift: 40}}"
    plain = scene.read_text()

    def choose(take: str) -> list[str]:
        edits = f"codec: ffv1, edits: {{line: 3, take: '{take}', takes: {takes}}}}}\n"
        scene.write_text(plain.replace("codec: ffv1}\n", edits))
        result, began = dub(scene)
        assert result.code == 0, result.outcomes
        return began

    def figures() -> dict[str, bool]:
        line = report_of(scene)["lines"][1]
        assert (line["line"], line["take"]) == (3, chosen)
        return {one["take"]: one["made"] for one in line["takes"]}

    chosen = ""
    choose(chosen)
    first = (scene.parent / "out" / "it.mkv").read_bytes()
    assert figures() == {"": True, "again": False, "late": False}
    for chosen, began in (
        ("late", ["it:render"]),  # (The stand-in heads do not depend on edits.)
        ("again", ["it:listen", "it:render", "it:composite", "it:check"]),
    ):
        assert choose(chosen) == began
        assert figures()[chosen]
    assert all(figures().values())
    heads = [*(scene.parent / "out" / "work" / "dubs" / "it" / "cues").glob("*/takes/*/render")]
    assert len(heads) == 2
    # Back to the first: nothing is heard or rendered again, and the film is as it was.
    chosen = ""
    assert choose(chosen) == ["it:composite", "it:check"]
    assert (scene.parent / "out" / "it.mkv").read_bytes() == first
    assert all(figures().values())
    # A changed take was not made as it is now.
    takes = takes.replace("shift: 40", "shift: 60")
    assert choose(chosen) == []
    assert figures() == {"": True, "again": True, "late": False}


def test_a_draft_is_the_scene_at_half_size(scene: Path) -> None:
    result, began = dub(scene, draft=True)
    assert result.code == 0, result.outcomes
    path = scene.parent / "out" / "it.draft.mp4"
    assert result.drafts == (path,)
    assert not {"render", "composite", "check"} & {name.split()[0] for name in began}
    info, film = media.probe(path), media.probe(scene.parent / "film.mp4")
    assert (info.width, info.height) == (film.width // 2, film.height // 2)
    assert info.frames == FRAMES
    assert info.sound_seconds == pytest.approx(float(FRAMES / FPS), abs=0.05)
    drawn = np.stack([*media.read_frames(path)])[:, 9:12, 11:14].mean((1, 2))
    filmed = np.stack([*media.read_frames(scene.parent / "film.mp4")])[:, 18:24, 22:28]
    # A head of 5 px is all edge: it is only much redder than the film.
    middles = [(first + stop) // 2 for first, stop in CUES]
    assert (drawn[middles, 0] > filmed.mean((1, 2))[middles, 0] + 60).all()
    spoken = [k for first, stop in CUES for k in range(first, stop)]
    left = np.setdiff1d(np.arange(FRAMES), spoken)
    assert np.abs(drawn - filmed.mean((1, 2)))[left].max() < 20
    # Nothing else is there: no report, no dub.
    assert sorted(p.name for p in (scene.parent / "out").iterdir()) == ["it.draft.mp4", "work"]
    assert dub(scene, draft=True)[1] == []


def test_another_process_finds_each_stage_by_its_key(scene: Path) -> None:
    add_clips(scene)
    made = jobs.build(load(scene))
    graph = nodes(made)
    cues = {f"dub/second/render ann_{first:07d}-{stop:07d}" for first, stop in CUES}
    assert cues <= {*map(str, graph)}
    assert len(graph) == sum(len(job.stages) for job in made.all())
    for job in made.all():
        found = task.job_of(job.label, str(scene), "auto").stages
        for name, stage in job.stages.items():
            assert found[name].folder == stage.folder
            assert found[name].fingerprints() == stage.fingerprints()


def test_what_is_loaded_beforehand_is_there() -> None:
    """Python says nothing of a module that it cannot load for the forks to come."""
    assert all(map(find_spec, task.LOADED))


def test_processes_make_a_scene_with_the_same_bytes(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(composite, "SEGMENT", 10)  # as in the processes of the stand-ins
    (scene.parent / "it.srt").write_text(SRT[: SRT.index("4\n00")])
    dub(scene)
    inline = (scene.parent / "out" / "it.mkv").read_bytes()
    shutil.rmtree(scene.parent / "out" / "work" / "dubs")
    with closing(Processes(task.program(scene), 2)) as executor:
        result, began = dub(scene, executor=executor)
    assert result.code == 0, result.outcomes
    kinds = ["listen", "render", "listen", "render", "composite", "check"]
    assert sorted(began) == sorted(f"it:{kind}" for kind in kinds)
    assert (scene.parent / "out" / "it.mkv").read_bytes() == inline


def test_a_lossy_codec_is_described_by_its_worst_frame(scene: Path) -> None:
    scene.write_text(scene.read_text().replace(", codec: ffv1", ""))
    dub(scene)
    work = scene.parent / "out" / "work" / "dubs" / "it"
    proof = json.loads((work / "composite" / "scene.json").read_text())["untouched"]
    assert not proof["identical"]
    assert proof["psnr"] > 30


def test_the_proof_of_what_stays_is_that_of_a_scene_made_anew(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.write_text(scene.read_text().replace(", codec: ffv1", ""))
    dub(scene)
    counted = []
    compared = untouched._compared

    def noted(*of: Any) -> Any:
        counted.append(int(of[2].sum()))
        return compared(*of)

    monkeypatch.setattr(untouched, "_compared", noted)
    (scene.parent / "it.srt").write_text(SRT.replace("00:00:01,668", "00:00:01,585"))
    dub(scene)
    composite = scene.parent / "out" / "work" / "dubs" / "it" / "composite"
    kept = json.loads((composite / "scene.json").read_text())
    shutil.rmtree(composite)
    dub(scene)
    assert json.loads((composite / "scene.json").read_text()) == kept
    assert counted[0] < counted[1] == kept["untouched"]["frames"]


def test_a_file_that_lacks_frames_is_refused(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mux = media.mux
    monkeypatch.setattr(media, "mux", lambda parts, *of, **more: mux(parts[:-1], *of, **more))
    result, _ = dub(scene)
    assert result.code != 0
    assert f"frames instead of {FRAMES}" in str(result.outcomes)


def add_clips(scene: Path) -> None:
    """Two more clips of Ann, in one of which nobody shows a face; a dub over each."""
    folder = scene.parent
    for name in ("noface", "second"):
        clips.write_clip(folder / f"{name}.mp4", FRAMES, FPS)
        clips.ffmpeg("-i", folder / f"{name}.mp4", "-vf", "hue=h=90", folder / f"{name}_.mp4")
        (folder / f"{name}_.mp4").rename(folder / f"{name}.mp4")
    text = scene.read_text().replace("clip: film.mp4", "clips: [film.mp4, second.mp4, noface.mp4]")
    (dubs,) = (text[text.index("  - {") :],)
    more = "".join(
        dubs.replace("name: it", f"name: {name}").replace("lines:", f"clip: {name}.mp4, lines:")
        for name in ("second", "noface")
    )
    scene.write_text(text.replace("lines:", "clip: film.mp4, lines:") + more)


def test_one_model_for_several_clips(scene: Path) -> None:
    folder = scene.parent
    add_clips(scene)
    result, began = dub(scene)
    assert result.code == 1
    assert began.count("ann:finetune") == 1
    assert began.count("ann:prepare") == 3
    assert began.count("ann:refine_poses") == 2
    states = {name: outcome.state for name, outcome in result.outcomes.items()}
    # One clip shows no face: the dubs over the others are made nevertheless.
    assert states == {
        "identity/ann": "failed",
        "dub/it": "made",
        "dub/second": "made",
        "dub/noface": "skipped",
    }
    made = list(media.read_frames(folder / "out" / "second.mkv"))
    film = list(media.read_frames(folder / "second.mp4"))
    assert np.array_equal(made[0], film[0])
    assert not np.array_equal(made[15], film[15])
    names = {p.name for p in (folder / "out" / "work" / "identities" / "ann" / "clips").iterdir()}
    assert names >= {"second"}
    assert dub(scene, only=("second",))[1] == []


def test_short_clips_of_one_person_are_learned_from_together(scene: Path) -> None:
    add_clips(scene)
    text = scene.read_text().replace(", noface.mp4]", "]")
    text = text[: text.index("  - {name: noface")].replace("seconds: 1", "seconds: 9")
    scene.write_text(text)
    result, began = dub(scene)
    assert result.code == 0, result.outcomes
    assert began.index("ann:finetune") > max(k for k, one in enumerate(began) if "prepare" in one)
    folder = scene.parent / "out" / "work" / "identities" / "ann"
    ((beside, _),) = json.loads((folder / "finetune" / "finetune.json").read_text())["beside"]
    assert beside == "second.mp4"
    assert dub(scene)[1] == []


def test_a_card_comes_after_the_scene_and_is_no_part_of_it(scene: Path) -> None:
    dub(scene)
    plain = [*media.read_frames(scene.parent / "out" / "it.mkv")]
    label = "codec: ffv1, label: {credits: {seconds: 1}}"
    scene.write_text(scene.read_text().replace("codec: ffv1", label))
    result, began = dub(scene)
    assert result.code == 0, result.outcomes
    assert began == ["it:composite", "it:check"]
    made = [*media.read_frames(scene.parent / "out" / "it.mkv")]
    assert len(made) == FRAMES + 24
    assert all(np.array_equal(*pair) for pair in zip(made, plain, strict=False))
    assert report_of(scene)["untouched"]["identical"]
    assert report_of(scene)["untouched"]["of"] == FRAMES
    assert task.job_of("dub/it", str(scene), "auto").stage(Check).credits == 24
