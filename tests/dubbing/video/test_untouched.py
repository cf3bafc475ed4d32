"""The proof that the film's own frames are in the finished file, and what of it is kept."""

from __future__ import annotations

from copy import deepcopy
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import RenderingError
from dubbing.video.untouched import Proof, prove
from dubbing.video.verification import as_before, verify
from tests import clips

pytestmark = pytest.mark.medium

RATE = Fraction(25)
FRAMES, SEGMENT = 38, 10
OWN = np.isin(np.arange(FRAMES), [*range(14), *range(22, FRAMES)])


def result(path: Path, film: Path, spoilt: int | None = None) -> Path:
    """The film, with other pixels where it is not its own, and in one frame that is."""
    with media.VideoWriter(path, 64, 48, RATE, "ffv1", pixels=media.probe(film).pixels) as writer:
        for k, planes in enumerate(media.read_planes(film)):
            add = 9 * (not OWN[k]) + 3 * (k == spoilt)
            writer.write([plane + np.uint8(add) for plane in planes])
    return path


def proof(film: Path, made: Path, before: Proof | None = None, same: Any = False) -> Proof:
    kept = np.zeros(FRAMES, bool) | np.asarray(same)
    return prove(film, made, OWN, RATE, SEGMENT, before, kept)


def test_every_segment_has_its_part(tmp_path: Path) -> None:
    film = clips.write_video(tmp_path / "film.mp4", FRAMES)
    whole = proof(film, result(tmp_path / "a.mkv", film))
    assert {first: part["frames"] for first, part in whole["parts"].items()} == {
        "0": 10,
        "10": 4,
        "20": 8,
        "30": 8,
    }
    assert whole["untouched"] is not None
    assert (whole["untouched"]["frames"], whole["untouched"]["of"]) == (OWN.sum(), FRAMES)
    assert (whole["untouched"]["identical"], whole["untouched"]["psnr"]) == (True, None)
    spoilt = proof(film, result(tmp_path / "b.mkv", film, spoilt=25))
    assert spoilt["untouched"] is not None
    assert not spoilt["untouched"]["identical"]
    assert spoilt["untouched"]["psnr"] == pytest.approx(20 * np.log10(255 / 3), abs=0.06)
    differ = [k for k, part in spoilt["parts"].items() if part != whole["parts"][k]]
    assert differ == ["20"]


def test_of_segments_that_are_as_before_nothing_is_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = clips.write_video(tmp_path / "film.mp4", FRAMES)
    made = result(tmp_path / "a.mkv", film)
    whole, read = proof(film, made), []
    planes = media.read_planes

    def noted(path: Path, **span: Any) -> Any:
        read.append((path.name, span["start"], span["count"]))
        return planes(path, **span)

    monkeypatch.setattr(media, "read_planes", noted)
    assert proof(film, made, whole, same=True) == whole
    assert read == []
    # One frame of the third segment differs: all of it is compared anew.
    assert proof(film, made, whole, same=np.arange(FRAMES) != 23) == whole
    assert read == [("film.mp4", 22, 8), ("a.mkv", 22, 8)]


def test_a_part_that_counts_other_frames_is_not_kept(tmp_path: Path) -> None:
    film = clips.write_video(tmp_path / "film.mp4", FRAMES)
    made = result(tmp_path / "a.mkv", film)
    whole = proof(film, made)
    fewer = deepcopy(whole)
    fewer["parts"]["10"]["frames"] = 3
    assert proof(film, made, fewer, same=True) == whole


def test_what_is_coded_as_before_need_not_be_decoded(tmp_path: Path) -> None:
    last = clips.write_video(tmp_path / "last.mov", FRAMES, codec="prores")
    content = bytearray(last.read_bytes())
    begins = [k for k in range(len(content) - 4) if content[k : k + 4] == b"icpf"]
    content[begins[15] + 300] ^= 1
    made = tmp_path / "made.mov"
    made.write_bytes(content)
    taken = np.arange(FRAMES) < 20
    same = as_before(made, last, taken)
    assert np.flatnonzero(~same).tolist() == [15, *range(20, FRAMES)]
    assert not as_before(made, tmp_path / "none.mov", taken).any()
    verify(last, FRAMES, RATE, same)
    with pytest.raises(RenderingError, match="38 frames instead of 39"):
        verify(last, FRAMES + 1, RATE, np.append(same, False))
    with pytest.raises(RenderingError, match="runs at 25 instead of 24"):
        verify(last, FRAMES, Fraction(24), same)


def test_what_is_new_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = clips.write_video(tmp_path / "v.mp4", FRAMES)
    counted, count = [], media.count_frames

    def noted(path: Path, *span: Any) -> int:
        counted.append(span[:2])
        return count(path, *span) - (span[:1] == (30,))

    monkeypatch.setattr(media, "count_frames", noted)
    with pytest.raises(RenderingError, match="37 frames instead of 38"):
        verify(path, FRAMES, RATE, np.arange(FRAMES) // 10 % 2 == 0)
    assert counted == [(10, 20), (30, 38)]
