"""`prepare` as a whole, on the synthetic speaker: truth, resuming, clips that cannot be used."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.errors import PreparationError
from dubbing.media import VideoWriter
from dubbing.preparation import PreparedClip, prepare
from dubbing.speaker.speaker import SpeakerTruth, make_speaker

SIZE, SECONDS = 256, 0.8


@pytest.fixture(scope="module")
def speaker(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SpeakerTruth]:
    folder = tmp_path_factory.mktemp("speaker")
    truth = make_speaker(folder, text="Good evening to you.", seconds=SECONDS, size=SIZE)
    return folder / "clip.mp4", truth


@pytest.fixture(scope="module")
def prepared(
    speaker: tuple[Path, SpeakerTruth], tmp_path_factory: pytest.TempPathFactory
) -> PreparedClip:
    return prepare(speaker[0], tmp_path_factory.mktemp("prepared"), size=SIZE)


def test_the_track_fits_the_speaker(
    speaker: tuple[Path, SpeakerTruth], prepared: PreparedClip
) -> None:
    truth = speaker[1]
    assert prepared.valid.all()
    assert len(prepared) == truth.frames
    assert prepared.residual_shift < 0.15
    # The two heads have frames of their own: one fixed turn between them.
    between = Rotation.from_matrix(prepared.rotation.transpose(0, 2, 1) @ truth.rotation).mean()
    apart = Rotation.from_matrix(truth.rotation.transpose(0, 2, 1) @ prepared.rotation) * between
    assert np.sqrt((np.rad2deg(apart.magnitude()) ** 2).mean()) < 0.5


def test_the_matte_covers_the_head_and_not_the_body(
    speaker: tuple[Path, SpeakerTruth], prepared: PreparedClip
) -> None:
    truth = speaker[1]
    for k, (_, matte, _) in enumerate(prepared.frames()):
        mine, theirs = matte.astype(float), truth.head[k].astype(float)
        assert np.minimum(mine, theirs).sum() / np.maximum(mine, theirs).sum() > 0.9


def test_a_run_killed_between_any_two_steps_ends_the_same(
    speaker: tuple[Path, SpeakerTruth], prepared: PreparedClip, tmp_path: Path
) -> None:
    for fatal in ("landmarks", "refinement", "background"):

        def die(step: str, share: float, fatal: str = fatal) -> None:
            if step == fatal and share > 0.3:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            prepare(speaker[0], tmp_path, size=SIZE, progress=die)
        assert not (tmp_path / "prepared.json").exists()
    prepare(speaker[0], tmp_path, size=SIZE)
    names = sorted(path.name for path in prepared.folder.iterdir())
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    for name in names:
        assert (tmp_path / name).read_bytes() == (prepared.folder / name).read_bytes(), name


def test_a_clip_without_a_face_says_what_to_do(tmp_path: Path) -> None:
    clip = tmp_path / "wall.mkv"
    with VideoWriter(clip, 128, 96, Fraction(25), "ffv1") as writer:
        for _ in range(6):
            writer.write(np.full((96, 128, 3), 120, np.uint8))
    with pytest.raises(PreparationError, match=r"no face found.*use a clip"):
        prepare(clip, tmp_path / "out", size=128)
    assert not (tmp_path / "out" / "prepared.json").exists()
