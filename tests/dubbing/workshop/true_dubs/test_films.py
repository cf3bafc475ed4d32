"""Scenes, what the camera adds, what comes before the face, and the manifest."""

import sys
from pathlib import Path

import numpy as np
import pytest

from dubbing.errors import ExplainedError
from dubbing.workshop.synthetic.anatomy.face import FACES
from dubbing.workshop.true_dubs import films, measure
from dubbing.workshop.true_dubs.camera_look import CameraLook
from dubbing.workshop.true_dubs.films import FIRST, MANIFEST, chosen, manifest, write
from dubbing.workshop.true_dubs.measure import cell, table
from dubbing.workshop.true_dubs.objects import GONE, RISES, THERE, hand, microphone, passed_by
from dubbing.workshop.true_dubs.scenes import FRAMES, LEARNED, RATE, SCENES, Look, Scene

S = 160


def test_there_are_scenes_enough_and_each_face_exists() -> None:
    names = [scene.name for scene in SCENES]
    assert len(names) == len(set(names)) >= 24
    assert {scene.face for scene in SCENES} <= set(FACES)


def test_how_a_head_turns() -> None:
    scenes = Scene("x", held=60), Scene("x", passing=80), Scene("x", nod=25)
    held, passing, nods = (scene.turns() for scene in scenes)
    assert (held[FIRST:, 1] == 60).all()
    assert held[0, 1] == 0
    assert (passing[:FIRST, 1] == 0).all()
    assert passing[:, 1].max() == pytest.approx(80, abs=1)
    assert passing[-1, 1] < 3
    assert np.ptp(nods[:, 0]) == pytest.approx(50, abs=1)
    assert len(held) == FRAMES


def test_a_camera_adds_the_same_each_time() -> None:
    image = np.random.default_rng(0).integers(0, 255, (S, S, 3), dtype=np.uint8)
    plain = CameraLook(Look(), S)
    np.testing.assert_array_equal(plain.picture(image, 9), image)
    for look in (Look(grain=9), Look(shake=4), Look(zoom=1.4), Look(flicker=0.4), Look(defocus=2)):
        camera = CameraLook(look, S)
        np.testing.assert_array_equal(camera.picture(image, 9), camera.picture(image, 9))
        assert (camera.picture(image, 150) != image).any()
    mono = CameraLook(Look(mono=True), S).picture(image, 0)
    assert (mono == mono[..., :1]).all()
    assert CameraLook(Look(shrink=0.5), S).picture(image, 0).shape == (S // 2, S // 2, 3)


@pytest.mark.parametrize("band", [0.8, -1.0])
def test_a_shadow_or_a_beam_passes_over_a_film_while_it_is_dubbed(band: float) -> None:
    image = np.full((S, S, 3), 100, np.uint8)
    camera = CameraLook(Look(band=band), S)
    lit = np.stack([camera.picture(image, t)[S // 2, :, 0] for t in range(FRAMES)]).astype(int)
    assert (lit[: round(LEARNED * RATE)] == 100).all()
    changed = np.sign(band) * (100 - lit) > 30
    assert changed.any(0).all()  # every column is in it once
    assert changed.mean(1).max() < 0.6
    assert not changed[-1].any()


def test_a_print_is_faded_while_it_is_dubbed() -> None:
    image = np.linspace(0, 255, S * S * 3).reshape(S, S, 3).astype(np.uint8)
    camera, first = CameraLook(Look(fade=0.3), S), round(LEARNED * RATE)
    np.testing.assert_array_equal(camera.picture(image, first - 1), image)
    assert np.ptp(camera.picture(image, first)) == pytest.approx(0.7 * 255, abs=1)
    assert camera.picture(image, first).min() > 50


def test_points_go_where_the_camera_shows_them() -> None:
    image = np.zeros((S, S, 3), np.uint8)
    image[59:62, 99:102] = 255
    for look in (Look(zoom=1.3), Look(shake=5), Look(shrink=0.5)):
        camera, t = CameraLook(look, S), 120
        shown = camera.picture(image, t).astype(float).sum(-1)
        rows, columns = np.indices(shown.shape)
        middle = np.array([(shown * columns).sum(), (shown * rows).sum()]) / shown.sum()
        np.testing.assert_allclose(camera.points(np.array([100.0, 60]), t), middle, atol=0.4)


def test_a_hand_rises_covers_the_mouth_and_leaves() -> None:
    mouth = np.array([80.0, 100])

    def covered(seconds: float) -> float:
        t = round((LEARNED + seconds) * RATE)
        return float(hand(t, mouth, S).opacity[92:108, 68:92].mean())

    assert covered(RISES - 0.1) < 0.05
    assert covered(THERE + 0.1) > 0.6
    assert covered(GONE + 0.1) < 0.05
    assert 0.2 < microphone(mouth, S).opacity[100:116, 76:92].mean() < 1


def test_who_passes_by_is_behind() -> None:
    person = np.zeros((S, S), np.uint8)
    person[40:, 60:100] = 255
    image = np.full((S, S, 3), 50, np.uint8)
    other = np.full((S, S, 3), 200, np.uint8), np.full((S, S), 255, np.uint8)
    seen = passed_by(image, person, other, FIRST + (FRAMES - FIRST) // 2)
    assert (seen[person > 0] == 50).all()
    assert (seen[person == 0] == 200).mean() > 0.8


def test_scenes_are_chosen_by_patterns() -> None:
    assert [scene.name for scene in chosen(["held-*", "front"])][:2] == ["front", "held-20"]
    with pytest.raises(ExplainedError, match="no scene is called nobody"):
        chosen(["nobody"])


def test_the_program_writes_films_and_their_manifest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written: list[str] = []
    monkeypatch.setattr(films, "write", lambda scene, out: written.append(scene.name))
    monkeypatch.setattr(sys, "argv", ["films", str(tmp_path), "--only", "held-*"])
    assert films.main() == 0
    assert written == ["held-20", "held-40", "held-60", "held-80"]
    assert "held-60/film.mkv" in (tmp_path / MANIFEST).read_text()
    monkeypatch.setattr(sys, "argv", ["measure", str(tmp_path), "--only", "held-60"])
    assert measure.main() == 1
    assert "dfrf dub" in capsys.readouterr().err


def test_a_table_says_what_it_knows() -> None:
    text = table({"front": {"dubbed": 1.0, "psnr": 31.26}})
    assert "| front | 100 % | 31.3 |" in text
    assert cell("cover_changed", 0.0123) == "1.2 %"
    assert cell("seam", None) == ""


@pytest.mark.slow
def test_the_films_of_a_scene_differ_in_the_mouth_alone(tmp_path: Path) -> None:
    from dubbing.manifest.manifest import load
    from dubbing.media import read_frames

    scene = Scene("tiny", size=64)
    write(scene, tmp_path)
    (tmp_path / MANIFEST).write_text(manifest([scene]))
    production = load(tmp_path / MANIFEST)
    assert list(production.dubs) == ["tiny"]
    film = list(read_frames(tmp_path / "tiny" / "film.mkv", start=FIRST))
    true = list(read_frames(tmp_path / "tiny" / "true.mkv"))
    assert len(film) == len(true) == FRAMES - FIRST
    with np.load(tmp_path / "tiny" / films.TRUTH) as known:
        mouths = known["mouths"]
    changed = np.zeros((64, 64))
    for a, b in zip(film, true, strict=True):
        changed += (np.abs(a.astype(int) - b) > 3).any(-1)
    rows, columns = np.nonzero(changed > 3)
    assert len(rows) > 50
    low, high = (
        (mouths[:, 0] - 2.2 * mouths[:, 1]).min(0),
        (mouths[:, 0] + 2.2 * mouths[:, 1]).max(0),
    )
    assert columns.min() > low[0]
    assert columns.max() < high[0]
    assert rows.min() > low[1] - 3
