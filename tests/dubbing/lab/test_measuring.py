"""What is measured on held-out frames, and what becomes of figures that are not known."""

import csv
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from dfrf import head_checkpoint, presets
from dfrf.metrics.lpips import Lpips
from dubbing.lab import measuring, tiles
from dubbing.lab.measuring import FrameFigures, held_out, mean_figures, measure
from tests import clips
from tests.dfrf.people import small_config
from tests.fakes import write_prepared

FIRST, COUNT = 4, 5


def figures(**known: float) -> FrameFigures:
    rest = dict.fromkeys(FrameFigures.__dataclass_fields__, 1.0)
    return FrameFigures(**{**rest, "frame": 0, **known})  # type: ignore[arg-type]


def test_means_are_of_the_frames_that_have_the_figure() -> None:
    nan = measuring.NOT_KNOWN
    means = mean_figures([figures(lmd=nan, lpips=nan), figures(lmd=3, lpips=nan, haarpsi=0.5)])
    assert means["lmd"] == 3
    assert means["haarpsi"] == 0.75
    assert "lpips" not in means
    assert "frame" not in means
    assert mean_figures([figures(sharpness_mouth=0.5)])["sharpness"] == 0.75


@pytest.mark.parametrize(
    ("seconds", "learned", "most", "expected"),
    [
        (20, 15, None, (375, 125)),
        (40, 15, None, (750, 250)),
        (18, 15, None, (375, 75)),
        (20, 15, 2.0, (375, 50)),
        (20, 15, 60.0, (375, 125)),
        (15, 15, 2.0, (375, 0)),
    ],
)
def test_the_end_of_a_clip_is_held_out(
    seconds: int, learned: float, most: float | None, expected: tuple[int, int]
) -> None:
    assert held_out(25 * seconds, Fraction(25), learned, most) == expected


def test_every_frame_and_every_figure_is_reported(tmp_path: Path) -> None:
    clips.write_video(tmp_path / "clip.mkv", FIRST + COUNT, codec="ffv1")
    random = np.random.default_rng(0)
    (tmp_path / "prepared").mkdir()
    clip = write_prepared(tmp_path / "clip.mkv", tmp_path / "prepared", invalid=(FIRST + 1,))
    shape = np.concatenate([random.uniform(-0.8, 0.8, (478, 2)), np.zeros((478, 1))], 1)
    marks = 4 + random.random((len(clip), 478, 2)) * 24
    replace(clip, landmarks=marks, shape=shape).save()
    model = presets.build(small_config(references=0, use_warp=False))
    head_checkpoint.save_person(tmp_path / "model.safetensors", model, None, {})
    means = measure(
        tmp_path / "model.safetensors",
        tmp_path / "prepared",
        random.random((len(clip), 16, 8)).astype(np.float32),
        FIRST,
        COUNT,
        tmp_path / "out",
        lpips=Lpips().eval(),
        device="cpu",
        progress=lambda message, share: None,
    )
    with (tmp_path / "out" / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["frame"]) for row in rows] == [4, 6, 7, 8]
    assert means["frames"] == 4
    for name in ("psnr", "ssim", "haarpsi", "lpips", "psnr_face", "psnr_mouth"):
        assert means[name] == pytest.approx(np.mean([float(row[name]) for row in rows]))
    assert 0 < means["haarpsi"] < 1
    assert "lmd" not in means  # there is no face to be found
    assert means["source_flicker"] > 0
    assert means["flicker"] >= 0
    assert (tmp_path / "out" / tiles.TILES_FILE).is_file()
