"""The steps call those who do the work the way these want to be called."""

from __future__ import annotations

import datetime
from fractions import Fraction
from pathlib import Path
from unittest.mock import create_autospec

import numpy as np
import pytest

from dubbing import tasks
from dubbing.files import atomic_write_json
from dubbing.manifest.entries import Consent, Dub, Finetune, Identity
from dubbing.script.timeline import Cue
from dubbing.stages.kinds import SYNC_FILE
from dubbing.stages.listen import Speech
from dubbing.tasks.dub import PART
from tests import clips, fakes

torch = pytest.importorskip("torch")


@pytest.fixture
def identity(tmp_path: Path) -> Identity:
    clip = clips.write_clip(tmp_path / "ann.mp4", 30)
    consent = Consent(by="a", date=datetime.date(2026, 11, 2), reference="b")
    return Identity.model_construct(
        clip=clip, consent=consent, seconds=1.0, finetune=Finetune(iterations=3)
    )


@pytest.fixture
def dub(tmp_path: Path) -> Dub:
    audio = clips.write_sound(tmp_path / "it.wav", 1.6)
    return Dub.model_construct(name="it", identity="ann", audio=audio)


def quiet(_message: str, _share: float) -> None:
    pass


def test_prepare(identity: Identity, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.preparation import prepare as preparing

    work = create_autospec(preparing.prepare)
    monkeypatch.setattr(preparing, "prepare", work)
    tasks.Prepare(identity, identity.clip, ())(tmp_path, quiet)
    work.assert_called_once_with(identity.clip, tmp_path, size=512, people=(), progress=quiet)


def test_finetune(identity: Identity, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.stages import finetune as finetuning
    from dubbing.sync.result import Media, SyncResult

    work = create_autospec(finetuning.finetune)
    monkeypatch.setattr(finetuning, "finetune", work)
    media = Media(75, "25", 3.0, 3.0, 2.0, 3.0)
    found = SyncResult("warn", "late", "lips", media, offset_frames=-3, confidence=0.2)
    (tmp_path / "source").mkdir()
    atomic_write_json(tmp_path / "source" / SYNC_FILE, found.to_json())
    fakes.write_prepared(identity.clip, tmp_path / "prepared")
    prepared = tasks.Prepared(tmp_path / "prepared", identity.clip)
    checks = (tmp_path / "source",)
    tasks.Finetune(identity, (prepared,), checks, None, "cpu")(tmp_path, quiet)
    (positional, named) = work.call_args
    ((clip, offset),), out = positional
    assert (clip.folder, offset, out) == (tmp_path / "prepared", -3, tmp_path)
    assert (named["start"], named["seconds"], named["device"]) == (0.0, 1.0, "cpu")
    settings = named["settings"]
    assert (settings.preset, settings.iterations, settings.seed) == ("fast", 3, 0)


def test_speech_then_heads(
    identity: Identity, dub: Dub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dubbing.stages import render as heads

    prepared, speech, out = tmp_path / "prepared", tmp_path / "speech", tmp_path / "heads"
    fakes.write_prepared(identity.clip, prepared)
    speech.mkdir()
    assert isinstance(dub.audio, Path)
    cue = Cue("ann", 0, 40, dub.audio, 0.0, 1.6)
    tasks.Listen(cue, "mel", None, Fraction(25))(speech, quiet)
    heard = Speech.load(speech)
    assert (heard.name, heard.frames, heard.rate) == ("mel", 40, 25)
    assert heard.features.shape == (80, 80)
    assert heard.voice.shape == (80,)
    work = create_autospec(heads.render)
    monkeypatch.setattr(heads, "render", work)
    c2w = np.random.default_rng(0).normal(size=(30, 3, 4))
    np.savez(tmp_path / "poses.npz", c2w=c2w)
    found = tasks.Prepared(prepared, identity.clip)
    tasks.Render(dub, cue, tmp_path / "model", found, tmp_path, speech, "cpu")(out, quiet)
    model, clip, listen, target = work.call_args[0]
    assert (model.name, clip.folder, target) == ("model.safetensors", prepared, out)
    np.testing.assert_allclose(clip.c2w()[:, :, :3], c2w[:, :, :3])  # the refined poses
    whole = listen(0, 40)
    assert whole.windows.shape == (40, 16, 80)
    np.testing.assert_array_equal(listen(13, 9).windows, whole.windows[13:22])
    np.testing.assert_allclose(listen(13, 9).lips, whole.lips[13:22], atol=1e-6)
    np.testing.assert_array_equal(work.call_args[1]["pose_index"], [*range(30), *range(28, 18, -1)])


def test_check_reads_the_sources_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    import dubbing.sync.check  # noqa: F401 (to be found in sys.modules)
    from dubbing.sync.result import Media, Motion, Segment, SyncResult

    media = Media(75, "25", 3.0, 3.0, 2.0, 3.0)
    motion = Motion(0.1, True, None, 1.0, None)
    segments = [Segment(0.0, 3.0, 1, 2.0, 0.5, 0.9)]
    found = SyncResult("pass", "fine", "lips", media, 1, 40.0, 2.0, 0.5, [0.0] * 31)
    found = SyncResult(**{**vars(found), "motion": motion, "segments": segments})
    module = sys.modules["dubbing.sync.check"]
    work = create_autospec(module.check, return_value=found)
    monkeypatch.setattr(module, "check", work)
    reported: list[float] = []
    tasks.Check(tmp_path / "clip.mp4")(tmp_path, lambda _message, share: reported.append(share))
    assert work.call_args[1]["source"] is None
    work.call_args[1]["progress"](0.25)
    assert reported == [0.25]
    (tmp_path / "dub").mkdir()
    tasks.Check(tmp_path / "dub.mp4", tmp_path / "sync.json")(tmp_path / "dub", quiet)
    assert work.call_args[1]["source"] == found


def test_a_long_cue_is_rendered_in_ranges(dub: Dub, tmp_path: Path) -> None:
    sound = tmp_path / "it.wav"

    def ranges(frames: int) -> dict[str, tuple[int, int] | None]:
        cue = Cue("ann", 100, 100 + frames, sound, 0.0, frames / 25)
        prepared = tasks.Prepared(tmp_path, tmp_path)
        whole = tasks.Render(dub, cue, tmp_path, prepared, tmp_path, tmp_path, "cpu")
        assert whole.frames == frames == sum(p.frames for p in whole.parts().values() or [whole])
        return {name: work.part for name, work in whole.parts().items()}

    assert ranges(PART) == {}
    assert ranges(501) == {"0-250": (0, 250), "250-500": (250, 500), "500-501": (500, 501)}
