"""Stages call the functions that do their work the way these want to be called."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import create_autospec

import numpy as np
import pytest

from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.errors import PreparationError
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.identity.lip_scale import LipScale
from dubbing.script.edit import Edit
from dubbing.sound_to_lips.cue_speech import Speech
from dubbing.stages.base import Prepared
from dubbing.stages.check import Check
from dubbing.stages.check_source import CheckSource
from dubbing.stages.finetune import Finetune, LearnedClip
from dubbing.stages.listen import Listen
from dubbing.stages.prepare import Prepare
from dubbing.stages.render import PART, Render
from dubbing.sync.records import SYNC_FILE
from dubbing.sync.result import Media, Segment, SyncResult
from tests import clips, fakes

torch = pytest.importorskip("torch")
FACTS = Media(75, "25", 3.0, 3.0, 2.0, 3.0)


class Made(Stage):
    """A stage whose results lie in its folder."""

    def run(self, out: Path, progress: Progress) -> None:
        raise AssertionError


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return clips.write_clip(tmp_path / "ann.mp4", 30)


def quiet(_message: str, _share: float) -> None:
    pass


def test_a_part_without_a_face_is_prepared_with_all_of_its_clip(
    clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dubbing.preparation import prepare as preparing

    none = PreparationError("no face found in any frame", "ann.mp4", "use another")
    work = create_autospec(preparing.prepare, side_effect=[none, None])
    monkeypatch.setattr(preparing, "prepare", work)
    stage = Prepare(clip=clip, size=512, people=(), part=(10, 20), weights={}, crops=30)
    stage.run(tmp_path, quiet)
    assert [call.kwargs["part"] for call in work.mock_calls] == [(10, 20), None]
    work.side_effect = [none, none]
    with pytest.raises(PreparationError, match="no face"):
        stage.run(tmp_path, quiet)


def test_prepare(clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.preparation import prepare as preparing

    work = create_autospec(preparing.prepare)
    monkeypatch.setattr(preparing, "prepare", work)
    Prepare(clip=clip, size=512, people=(), weights={}, crops=30).run(tmp_path, quiet)
    work.assert_called_once_with(clip, tmp_path, size=512, people=(), part=None, progress=quiet)


def test_finetune(clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.heads import fine_tuning

    work = create_autospec(fine_tuning.finetune)
    monkeypatch.setattr(fine_tuning, "finetune", work)
    result = SyncResult("warn", "late", "lips", FACTS, offset_frames=-3, confidence=0.2)
    (tmp_path / "source").mkdir()
    atomic_write_json(tmp_path / "source" / SYNC_FILE, result.to_json())
    fakes.write_prepared(clip, tmp_path / "prepared")
    prepared = Prepared(Made(folder=tmp_path / "prepared"), clip)
    stage = Finetune(
        clips=(LearnedClip(prepared, Made(folder=tmp_path / "source")),),
        start=0.0,
        seconds=1.0,
        settings=FinetuneSettings(iterations=3, seed=5, speech="mel", rays=128),
        base=None,
        weights={},
        crops=25.0,
        device="cpu",
    )
    stage.run(tmp_path, quiet)
    (positional, named) = work.call_args
    ((one, offset),), out = positional
    assert (one.folder, offset, out) == (tmp_path / "prepared", -3, tmp_path)
    assert (named["start"], named["seconds"], named["device"]) == (0.0, 1.0, "cpu")
    assert named["settings"] == stage.settings


def render(folder: Path, clip: Path, **changed: Any) -> Render:
    """A render of frames 0 to 40 of a dub over a clip."""
    given: dict[str, Any] = {
        "model": Made(folder=folder / "model"),
        "prepared": Prepared(Made(folder=folder / "prepared"), clip),
        "poses": Made(folder=folder),
        "speech": Made(folder=folder / "speech"),
        "first": 0,
        "stop": 40,
        "film_first": 0,
        "on_longer_audio": "bounce",
        "baked": True,
        "edit": Edit(),
        "learned": (),
        "preset": "fast",
        "crop": 0.5,
        "device": "cpu",
    }
    return Render(**{**given, **changed})


def test_speech_then_heads(clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.heads import rendering

    prepared, speech, out = tmp_path / "prepared", tmp_path / "speech", tmp_path / "heads"
    fakes.write_prepared(clip, prepared)
    speech.mkdir()
    audio = clips.write_sound(tmp_path / "it.wav", 1.6)
    Listen(
        audio=audio,
        audio_start=0.0,
        seconds=1.6,
        speech="mel",
        rate=Fraction(25),
        weights={},
        speech_weights=None,
    ).run(speech, quiet)
    heard = Speech.load(speech)
    assert (heard.name, heard.frames, heard.rate) == ("mel", 40, 25)
    assert heard.features.shape == (80, 80)
    assert heard.voice.shape == (80,)
    work = create_autospec(rendering.render)
    monkeypatch.setattr(rendering, "render", work)
    c2w = np.random.default_rng(0).normal(size=(30, 3, 4))
    np.savez(tmp_path / "poses.npz", c2w=c2w)
    none = np.zeros(30, bool)
    sizes = {"landmarks": (478, 2), "jaw": (48,), "grade": (3,), "lip_colour": (3,)}
    found = {name: np.zeros((30, *size)) for name, size in sizes.items()}
    np.savez(tmp_path / "covers.npz", allow_pickle=False, over=none, covered=none, **found)
    render(tmp_path, clip).run(out, quiet)
    model, film, listen, target = work.call_args[0]
    assert (model.name, film.folder, target) == ("model.safetensors", prepared, out)
    np.testing.assert_allclose(film.c2w()[:, :, :3], c2w[:, :, :3])  # the refined poses
    whole = listen(0, 40)
    assert whole.windows.shape == (40, 16, 80)
    np.testing.assert_array_equal(listen(13, 9).windows, whole.windows[13:22])
    np.testing.assert_allclose(listen(13, 9).lips, whole.lips[13:22], atol=1e-6)
    np.testing.assert_array_equal(work.call_args[1]["pose_index"], [*range(30), *range(28, 18, -1)])
    np.testing.assert_array_equal(work.call_args[1]["strength"], np.ones(40))
    # An edited line: the mouth 80 ms later, two frames, then half a frame earlier.
    render(tmp_path, clip, edit=Edit(shift=80, strength=0.5)).run(out, quiet)
    late, named = work.call_args[0][2], work.call_args[1]
    np.testing.assert_array_equal(late(13, 9).lips, whole.lips[11:20])
    np.testing.assert_array_equal(late(13, 9).windows, whole.windows[11:20])
    assert late(0, 1).windows[:, :11].max() < 1e-9  # before the recording it is silent
    np.testing.assert_array_equal(named["strength"], np.full(40, 0.5))
    render(tmp_path, clip, edit=Edit(shift=-20)).run(out, quiet)
    early = work.call_args[0][2](13, 9)
    between = whole.windows[13:22, 1:]  # 20 ms on: its steps, one later
    np.testing.assert_allclose(early.windows[:, :-1], between, atol=1e-6)
    assert not np.array_equal(early.lips, whole.lips[13:22])
    # Curves in eye distances become measures of the person; two frames later, as the mouth is.
    assert named["lips"] is None
    (tmp_path / "curves.csv").write_text("time,opening\n0.1,0.5\n0.22,0.8\n")
    scale_of = create_autospec(LipScale.of, return_value=LipScale(np.full(7, 0.2), np.full(7, 0.1)))
    monkeypatch.setattr(LipScale, "of", scale_of)
    edit = Edit(shift=80, curves=(tmp_path / "curves.csv", 1))
    learned = (Prepared(Made(folder=prepared), clip),)
    render(tmp_path, clip, edit=edit, learned=learned).run(out, quiet)
    ((folder, (one,)), _) = scale_of.call_args
    assert (folder, one.folder) == (tmp_path / "model", prepared)
    lips = work.call_args[1]["lips"]
    assert lips.shape == (40, 8)
    assert (np.flatnonzero(~np.isnan(lips[:, 0])) == [4, 5, 6, 7]).all()
    np.testing.assert_allclose(lips[4:8, 0], [3, 4, 5, 6], atol=1e-5)
    assert np.isnan(lips[:, 1:]).all()


def test_check_reads_the_sources_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import dubbing.sync.check  # noqa: F401 (to be found in sys.modules)

    segments = [Segment(0.0, 3.0, 1, 2.0, 0.5, 0.9)]
    result = SyncResult("pass", "fine", "lips", FACTS, 1, 40.0, 2.0, 0.5, [0.0] * 31)
    result = SyncResult(**{**vars(result), "segments": segments})
    module = sys.modules["dubbing.sync.check"]
    work = create_autospec(module.check, return_value=result)
    monkeypatch.setattr(module, "check", work)
    reported: list[float] = []
    source = CheckSource(folder=tmp_path, clip=tmp_path / "clip.mp4", weights={}, frames=75)
    source.run(tmp_path, lambda _message, share: reported.append(share))
    work.call_args[1]["progress"](0.25)
    assert reported == [0.25]
    (tmp_path / "check").mkdir()
    stage = Check(
        video=Made(folder=tmp_path / "composite"),
        source=source,
        codec="ffv1",
        options={"film": "LogC4"},
        spoken=((3, 9),),
        credits=7,
        weights={},
    )
    stage.run(tmp_path / "check", quiet)
    assert work.call_args[0] == (tmp_path / "composite" / "video.mkv;film=LogC4",)
    named = work.call_args[1]
    assert (named["source"], named["voices"]) == (result, None)
    assert (named["parts"], named["leave_out"]) == (((3, 9),), 7)


def test_a_long_cue_is_rendered_in_ranges(tmp_path: Path) -> None:
    def ranges(frames: int) -> dict[str, tuple[int, int] | None]:
        whole = render(tmp_path, tmp_path, first=100, stop=100 + frames)
        parts = whole.parts()
        amounts = [part.amount() for part in parts.values()] or [whole.amount()]
        assert sum(amounts) == whole.amount() == frames / 2
        assert all(part.key() == whole.key() for part in parts.values())
        return {name: part.part for name, part in parts.items()}

    assert ranges(PART) == {}
    assert ranges(501) == {"0-250": (0, 250), "250-500": (250, 500), "500-501": (500, 501)}
