"""The manifest of an earlier cut gets the dubs of a new one; what can stay does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from dubbing.errors import ManifestError
from dubbing.manifest.keys import yaml_lines
from tests import clips
from tests.dubbing.timelines import cuts
from tests.dubbing.timelines.cuts import FILM_RATE, Piece, written


def recorded(folder: Path, cut: list[Piece]) -> None:
    """A recording along a cut in which every frame of a film has speech of its own."""
    source, rate = soundfile.read(folder / "voice.wav")
    each = rate // 25
    sound = [source[:0]]
    for piece in cut:
        start = (piece.film * cuts.LENGTH + piece.first) * each
        sound.append(source[start : start + (piece.stop - piece.first) * each])
    soundfile.write(folder / "cut_it.wav", np.concatenate(sound), rate, "PCM_24")


@pytest.fixture
def first_cut(folder: Path) -> list[Piece]:
    clips.write_noise(folder / "voice.wav", 7 * cuts.LENGTH / 25, 2000)
    return laid([(k % 7, 20 + 3 * k, 60 + 3 * k) for k in range(40)])


def laid(parts: list[tuple[int, int, int]]) -> list[Piece]:
    """Frames of films one after another."""
    found, at = [], 0
    for film, first, stop in parts:
        found.append(Piece(film, first, stop, at))
        at += stop - first
    return found


def of(piece: Piece) -> tuple[int, int, int]:
    return piece.film, piece.first, piece.stop


def cut_again(folder: Path, pieces: list[Piece]) -> tuple[list[dict[str, Any]], list[str]]:
    recorded(folder, pieces)
    (folder / "voice.wav").rename(folder / "voice.kept")
    try:
        return written(folder, cuts.write(folder / "cut.edl", pieces, FILM_RATE), handles=8)
    finally:
        (folder / "voice.kept").rename(folder / "voice.wav")


def without_events(dubs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: dub[key] for key in dub if key != "events"} for dub in dubs]


def test_clips_that_moved_with_their_speech_keep_their_dubs(
    folder: Path, first_cut: list[Piece]
) -> None:
    before, _ = cut_again(folder, first_cut)
    speech = {path: path.stat().st_mtime_ns for path in (folder / "manifest.speech").iterdir()}
    moved = laid([of(piece) for piece in [*first_cut[30:], *first_cut[:10], *first_cut[12:30]]])
    after, said = cut_again(folder, moved)
    assert without_events(after) == [
        dub for k, dub in enumerate(without_events(before)) if k not in (10, 11)
    ]
    assert {p: p.stat().st_mtime_ns for p in speech} == speech
    assert said[1] == "38 of 38 events lie in dubs that were there"
    assert said[2:] == [f"not used any more: {before[k]['name']}" for k in (10, 11)]
    assert after[0]["events"] == [11]  # where it lies now


def test_clips_trimmed_within_their_handles_keep_their_dubs(
    folder: Path, first_cut: list[Piece]
) -> None:
    before, _ = cut_again(folder, first_cut)
    inner = [(p.film, p.first + 3, p.stop - 2) for p in first_cut]
    after, said = cut_again(folder, laid(inner))
    assert without_events(after) == without_events(before)
    assert said[1:] == ["40 of 40 events lie in dubs that were there"]
    longer = [(p.film, p.first - 5, p.stop) for p in first_cut[:1]] + inner[1:]
    after, said = cut_again(folder, laid(longer))
    # Its frames are there; what is said in them now was not heard before.
    assert [dub["name"] for dub in after] == [dub["name"] for dub in before]
    assert [line.partition(":")[0] for line in said[2:]] == ["other speech"]
    for beyond in ((0, 5, 60), (0, 20, 70)):
        after, said = cut_again(folder, laid([beyond, *inner[1:]]))
        assert said[1] == "39 of 40 events lie in dubs that were there"
        assert len([line for line in said if line.startswith("new: event 001")]) == 1


def test_other_speech_over_the_same_frames_changes_one_dub(
    folder: Path, first_cut: list[Piece]
) -> None:
    cut_again(folder, first_cut)
    sound, rate = soundfile.read(folder / "cut_it.wav")
    sound[(first_cut[5].at + 10) * rate // 25] = 0.5
    soundfile.write(folder / "cut_it.wav", sound, rate, "PCM_24")
    (folder / "voice.wav").unlink()
    dubs, said = written(folder, folder / "cut.edl", handles=8)
    assert said[2:] == [f"other speech: event 006 at 01:00:08:00 (shot5.mov): {dubs[5]['name']}"]


def test_the_same_frames_with_two_speeches_are_two_dubs(folder: Path) -> None:
    twice = [Piece(0, 20, 60, 0), Piece(1, 20, 60, 40), Piece(0, 20, 60, 80)]
    dubs, _ = written(folder, cuts.write(folder / "cut.edl", twice, FILM_RATE))
    assert [(dub["name"], dub["events"]) for dub in dubs] == [
        ("shot0_000020", [1]),
        ("shot1_000020", [2]),
        ("shot0_000020_2", [3]),
    ]


def test_a_new_cut_changes_the_dubs_alone(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(3), FILM_RATE)
    written(folder, cut)
    path = folder / "manifest.yaml"
    edited = path.read_text().replace('by: ""', 'by: "Ann"').replace("person", "ann")
    edited = edited.replace("seed: 0, on_longer_audio: cut}", "codec: prores}  # at last")
    path.write_text(edited)
    written(folder, cuts.write(cut, cuts.pieces(4), FILM_RATE))
    now = yaml_lines.read(path.read_text()).data
    assert (folder / "manifest.previous.yaml").read_text() == edited
    assert "# at last" in path.read_text()
    assert now["defaults"]["codec"] == "prores"
    assert now["identities"]["ann"]["clips"] == [f"shot{k}.mov" for k in range(4)]
    assert [dub["identity"] for dub in now["dubs"]] == ["ann"] * 4


def test_new_speech_takes_no_dub_from_a_clip_that_keeps_its_own(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", [Piece(0, 20, 60, 0)], FILM_RATE)
    before, _ = written(folder, cut)
    sound, rate = soundfile.read(folder / "cut_it.wav")
    soundfile.write(folder / "cut_it.wav", np.concatenate([sound[::-1], sound]), rate, "PCM_24")
    end = len(sound) * 25 // rate
    cuts.write(cut, [Piece(0, 20, 60, 0), Piece(0, 20, 60, end)], FILM_RATE)
    dubs, said = written(folder, cut)
    assert [(dub["name"], dub["events"]) for dub in dubs] == [
        (before[0]["name"], [2]),
        ("shot0_000020_2", [1]),
    ]
    assert not [line for line in said if line.startswith("other speech")]


def test_a_link_to_a_film_is_found_by_its_own_name_and_listed_once(folder: Path) -> None:
    (folder / "shot0.mov").rename(folder / "a1b2")
    (folder / "shot0.mov").symlink_to(folder / "a1b2")
    cut = cuts.write(folder / "cut.edl", cuts.pieces(2), FILM_RATE)
    before, _ = written(folder, cut)
    after, _ = written(folder, cut)
    people = yaml_lines.read((folder / "manifest.yaml").read_text()).data["identities"]
    assert people["person"]["clips"] == ["shot0.mov", "shot1.mov"]
    assert after == before


def test_a_scene_of_a_whole_film_holds_its_events(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(2), FILM_RATE)
    written(folder, cut)
    path = folder / "manifest.yaml"
    scene = "{name: scene, identity: person, clip: shot0.mov, lines: a.srt, audio: a.wav}"
    rows = [row for row in path.read_text().splitlines() if "clip: shot0" not in row]
    path.write_text("\n".join([*rows, f"  - {scene}", ""]))
    dubs, said = written(folder, cut)
    assert [(dub["name"], dub["events"]) for dub in dubs][1] == ("scene", [1])
    assert dubs[1]["audio"] == "a.wav"
    assert said[1:] == ["2 of 2 events lie in dubs that were there"]


def test_a_broken_manifest_is_named(folder: Path) -> None:
    cut = cuts.write(folder / "cut.edl", cuts.pieces(1), FILM_RATE)
    for text in ("dubs: [", "timeline: cut.edl\nidentities: [1]\n", "7"):
        (folder / "manifest.yaml").write_text(text)
        with pytest.raises(ManifestError, match=r"manifest\.yaml"):
            written(folder, cut)
