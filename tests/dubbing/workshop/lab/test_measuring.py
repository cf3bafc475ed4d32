"""What is measured on held-out frames, and what becomes of figures that are not known."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dfrf import presets, saved_models
from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.workshop.lab import measuring, tiles
from dubbing.workshop.lab.measuring import FrameFigures, mean_figures, measure
from dubbing.workshop.lab.metrics.lpips import Lpips
from tests import clips
from tests.dfrf.people import small_config
from tests.dubbing.sync.meshes import talk
from tests.dubbing.workshop.lab.faces import show_faces
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


FIRST, COUNT = 4, 5


def figures(**known: float) -> FrameFigures:
    rest = dict.fromkeys(FrameFigures.__dataclass_fields__, 1.0)
    return FrameFigures(**{**rest, "frame": 0, **known})  # type: ignore[arg-type]


def test_means_are_of_the_frames_that_have_the_figure() -> None:
    nan = measuring.NOT_KNOWN
    means = mean_figures(
        [figures(lmd_picture=nan, lpips=nan), figures(lmd_picture=3, lpips=nan, haarpsi=0.5)]
    )
    assert means["lmd_picture"] == 3
    assert means["haarpsi"] == 0.75
    assert "lpips" not in means
    assert "frame" not in means
    assert mean_figures([figures(sharpness_mouth=0.5)])["sharpness"] == 0.75


@pytest.fixture
def person(tmp_path: Path) -> Path:
    """A folder with a prepared clip of noise landmarks, and a tiny model that was never trained."""
    clips.write_video(tmp_path / "clip.mkv", FIRST + COUNT, codec="ffv1")
    random = np.random.default_rng(0)
    (tmp_path / "prepared").mkdir()
    clip = write_prepared(tmp_path / "clip.mkv", tmp_path / "prepared", invalid=(FIRST + 1,))
    shape = np.concatenate([random.uniform(-0.8, 0.8, (478, 2)), np.zeros((478, 1))], 1)
    marks = 4 + random.random((len(clip), 478, 2)) * 24
    replace(clip, landmarks=marks, shape=shape).save()
    model = presets.build(small_config(references=0, use_warp=False))
    saved_models.save_person(tmp_path / "model.safetensors", model, None, {})
    return tmp_path


def measured(folder: Path, every: int = 1) -> tuple[dict[str, float], list[dict[str, str]]]:
    """Figures and the rows of frames.csv."""
    windows = np.random.default_rng(1).random((FIRST + COUNT, 16, 8)).astype(np.float32)
    speech = SpeechFrames(windows, np.zeros((len(windows), NUMBERS), np.float32))
    out = folder / f"out{every}"
    means = measure(
        *(
            folder / "model.safetensors",
            PreparedClip.load(folder / "prepared"),
            speech,
            FIRST,
            COUNT,
            out,
        ),
        every=every,
        lpips=Lpips().eval(),
        device="cpu",
        progress=lambda message, share: None,
    )
    assert (out / tiles.TILES_FILE).is_file()
    with (out / "frames.csv").open() as file:
        return means, list(csv.DictReader(file))


def test_every_frame_and_every_figure_is_reported(person: Path) -> None:
    means, rows = measured(person)
    assert [int(row["frame"]) for row in rows] == [4, 6, 7, 8]
    assert means["frames"] == 4
    for name in ("psnr", "ssim", "haarpsi", "lpips", "psnr_face", "psnr_mouth"):
        assert means[name] == pytest.approx(np.mean([float(row[name]) for row in rows]))
    assert 0 < means["haarpsi"] < 1
    # There is no face to be found.
    assert not {"lmd", "lmd_picture", "opening_r", "missed"} & set(means)
    assert means["source_flicker"] > 0
    assert means["flicker"] >= 0


def test_the_mouths_of_render_and_source_are_compared(
    person: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gaps = np.array([0.0, 0.1, 0.2, 0.05])
    # In the render the mouth opens half as far; 16 px are an eye distance.
    show_faces(monkeypatch, measuring, [talk(gaps / 2), talk(gaps)], scale=16)
    means, rows = measured(person)
    assert means["opening_r"] == pytest.approx(1)
    assert means["opening_ratio"] == pytest.approx(0.5, rel=0.01)
    assert means["closure_f1"] == 1
    assert means["missed"] == 0
    assert means["lmd"] == pytest.approx(np.mean([float(row["lmd"]) for row in rows]))
    assert 0 < means["lmd"] <= means["lip_rms"]
    assert means["texture_ratio"] > 0


def test_one_frame_of_several_is_the_same_frame(person: Path) -> None:
    _, all_rows = measured(person)
    means, rows = measured(person, every=2)
    assert [int(row["frame"]) for row in rows] == [4, 6, 8]
    assert means["frames"] == 3
    for row in rows:
        same = next(x for x in all_rows if x["frame"] == row["frame"])
        assert float(row["psnr"]) == pytest.approx(float(same["psnr"]))
    # Nothing that needs frames in a row.
    assert "flicker" not in means
    assert not list((person / "out2").glob("*.mp4"))


def test_one_mouth_of_several_says_nothing_of_how_it_moves(
    person: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gaps = np.array([0.0, 0.1, 0.2])
    show_faces(monkeypatch, measuring, [talk(gaps), talk(gaps)], scale=16)
    means, _ = measured(person, every=2)
    assert means["lmd"] == pytest.approx(0, abs=1e-6)
    assert not {"opening_r", "closure_f1", "closure_f1_near", "closure_mcc", "lag_ms"} & set(means)
