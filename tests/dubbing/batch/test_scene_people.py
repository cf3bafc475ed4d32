"""A film of three people, found by their looks: the right face, to the frame, and nothing else."""

from __future__ import annotations

import csv
import json
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.script.timecode import frame_of
from dubbing.stages.prepare import Prepare
from tests import clips, fakes
from tests.dubbing.batches import dub

pytestmark = pytest.mark.medium


FPS = Fraction(24000, 1001)
SHOTS = (("alba", "chidi", "dora"), ("dora", "alba", "chidi"), ("chidi", "dora", "alba"))
LENGTH, SIDE = 20, 128  # of a shot, of a person
PILLAR = np.arange(9, 12)  # stands before Alba
# Lines by frame: who, first, stop. The third is Dora's, whom nobody dubs.
LINES = (("alba", 2, 18), ("chidi", 23, 35), ("dora", 35, 38), ("alba", 44, 56))
PREPARE = Prepare.run


@pytest.fixture
def film(tmp_path: Path, people: dict[str, np.ndarray]) -> Path:
    """The manifest of the scene, with all that it names. Each of two people has one point."""
    frames = np.concatenate([np.concatenate([people[n] for n in shot], 2) for shot in SHOTS])
    frames[PILLAR, :, 14:114] = np.array([90, 80, 70], np.uint8)
    silent, sound = tmp_path / "silent.mkv", clips.write_sound(tmp_path / "own.wav", 4)
    with media.VideoWriter(silent, 3 * SIDE, SIDE, FPS, "ffv1") as writer:
        for frame in frames:
            writer.write(frame)
    clips.ffmpeg("-i", silent, "-i", sound, "-shortest", "-c:v", "copy", tmp_path / "film.mkv")
    rows = []
    for number, (who, first, stop) in enumerate(LINES, 1):
        times = [f"00:00:0{float(at / FPS):.3f}".replace(".", ",") for at in (first, stop)]
        rows.append(f"{number}\n{' --> '.join(times)}\n{who.upper()}: Line {number}.\n")
        clips.write_sound(tmp_path / f"{number}.wav", float((stop - first) / FPS), hertz=500)
    (tmp_path / "it.srt").write_text("\n".join(rows))
    music = np.tile(clips.tone(4, 48000, hertz=97) / 4, (1, 2))
    soundfile.write(tmp_path / "me.wav", music, 48000)
    points = {"alba": 1 / 6, "chidi": 1 / 2}
    path = tmp_path / "m.yaml"
    path.write_text(
        "version: 1\noutput: out\n"
        f"defaults: {{size: {SIDE}, seconds: 3, clip: film.mkv, consent: {clips.CONSENT}}}\n"
        "identities:\n"
        + "".join(f"  {n}: {{face: {{at: 0.1, x: {x:.3f}, y: 0.5}}}}\n" for n, x in points.items())
        + "dubs:\n"
        "  - {name: it, lines: it.srt, speakers: {ALBA: alba, CHIDI: chidi}, audio: '{cue}.wav',\n"
        "     music_effects: me.wav, loudness: r128, mark: false, label: false, codec: ffv1}\n"
    )
    return path


@pytest.mark.slow
def test_three_people_two_cuts_and_a_pillar(film: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fakes.install(monkeypatch.setattr)
    monkeypatch.setattr(Prepare, "run", PREPARE)  # models alone are stand-ins
    result, _ = dub(film)
    assert result.code == 0, result.outcomes
    out = film.parent / "out"
    made, own = (
        np.stack([*media.read_frames(path)]) for path in (out / "it.mkv", film.parent / "film.mkv")
    )
    changed = (made != own).any((1, 3)).reshape(len(own), 3, SIDE).any(2)
    expected = np.zeros_like(changed)
    for who, first, stop in LINES:
        if who != "dora":
            expected[first:stop, SHOTS[first // LENGTH].index(who)] = True
    hidden = (PILLAR[0], PILLAR[-1] + 1)
    around = slice(hidden[0] - 2, hidden[1] + 2)
    assert not changed[slice(*hidden), 0].any()
    changed[around] = expected[around] = False
    np.testing.assert_array_equal(changed, expected)  # the right faces at the right times

    scene = json.loads((out / "work" / "dubs" / "it" / "composite" / "scene.json").read_text())
    assert scene["untouched"]["identical"]
    assert scene["untouched"]["frames"] == len(own) - 40
    assert [cue["loudness"] for cue in scene["sound"]["cues"]] == pytest.approx([-23] * 3, abs=0.5)
    faces = json.loads((out / "work" / "dubs" / "it" / "composite" / "picture.json").read_text())
    (behind,) = faces["own_pixels"]
    assert behind["reason"] in ("no face", "covered")
    kept = (behind["first"], behind["stop"])
    assert around.start <= kept[0] <= hidden[0] < hidden[1] <= kept[1] <= around.stop

    rows = list(csv.DictReader((out / "it.lines.csv").read_text().splitlines()))
    assert [row["own_pixels_frames"] for row in rows] == [str(kept[1] - kept[0]), "0", "0"]
    event = re.compile(r"^\d{3}  001 +V +C +\S+ \S+ (\S+) (\S+)\n\* LOC: \S+ (\w+)", re.MULTILINE)
    events = [(frame_of(a, FPS), frame_of(b, FPS), c) for a, b, c in event.findall(
        (out / "it.edl").read_text()
    )]  # fmt: skip
    # Without a check of their own, lines are blue.
    spoken = [(first, stop, "BLUE") for who, first, stop in LINES if who != "dora"]
    assert events == [spoken[0], (*kept, "CYAN"), *spoken[1:]]
    page = (out / "report.html").read_text()
    assert "found by looks in the shots that begin at frames" in page
    assert f'"own_pixels": "{behind["reason"]} {kept[0]}-{kept[1]}' in page
