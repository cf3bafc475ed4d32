"""Keys that shut the mouth on labials: where they go, and what of an edit stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from dubbing.batch import closures
from dubbing.cli.main import app
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.edits_file import edits_file
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from tests import clips
from tests.dubbing.studio.stand_in import write_scene

pytestmark = pytest.mark.medium


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A manifest of a scene of two lines, whose words are the seconds of their closures."""
    path = write_scene(tmp_path)
    (tmp_path / "it.srt").write_text(
        (tmp_path / "it.srt").read_text().replace("One.", "0.1 0.4").replace("Three.", "0.3")
    )
    monkeypatch.setattr(
        closures, "opened", lambda made, _: [(dub, None) for dub in made.dubs.values()]
    )
    monkeypatch.setattr(
        closures, "closures_of", lambda cue, _: [float(at) for at in cue.words.split()]
    )
    return path


def edits(path: Path) -> Any:
    return yaml_lines.read(edits_file(path, "it").read_text()).data


def test_they_are_keys_of_the_lines(path: Path) -> None:
    result = CliRunner().invoke(app, ["closures", str(path)])
    assert result.output.splitlines() == ["it, line 1: 2 closures", "it, line 3: 1 closures"]
    assert edits(path) == [
        {"line": 1, "keys": [{"at": 0.1, "strength": 0}, {"at": 0.4, "strength": 0}]},
        {"line": 3, "keys": [{"at": 0.3, "strength": 0}]},
    ]
    before = edits_file(path, "it").read_bytes()
    assert CliRunner().invoke(app, ["closures", str(path)]).exit_code == 0
    assert edits_file(path, "it").read_bytes() == before


def test_what_is_there_stays(path: Path) -> None:
    takes = "take: soft, takes: {soft: {shift: 40, keys: [{at: 0.32, strength: 1.2}]}, late: {}}"
    edits_file(path, "it").write_text(f"{{line: 1, note: a, strength: 0.7, {takes}}}")
    assert len([*closures.write_closures(load(path))]) == 2
    keys = [{"at": 0.1, "strength": 0}, {"at": 0.32, "strength": 1.2}]
    soft = {"shift": 40, "keys": keys}
    assert edits(path)[0] == {
        **{"line": 1, "strength": 0.7, "note": "a", "take": "soft"},
        "takes": {"soft": soft, "late": {}},
    }


def test_a_mouth_opens_between_two_closures_if_it_can() -> None:
    def keys(*at: float) -> list[tuple[float, float]]:
        return closures.with_closures([], at, 0.8)

    assert keys(0.2, 0.3) == [(0.2, 0), (0.3, 0)]
    assert keys(0.2, 0.4) == [(0.2, 0), (0.3, 0.8), (0.4, 0)]
    assert keys(0.2, 0.5) == [(0.2, 0), (0.5, 0)]  # the line's strength comes back by itself
    for apart, opens in ((0.1, False), (0.14, True), (0.2, True), (0.26, True), (0.4, True)):
        strengths = Edit(0, 0.8, keys=tuple(keys(0.2, 0.2 + apart))).strengths(50, 50)  # type: ignore[arg-type]
        between = strengths[np.arange(50) / 50 + 0.01 > 0.2][: round(apart * 50)]
        assert bool(between.max() > 0.7) is opens, apart


def test_a_key_that_somebody_set_is_not_doubled() -> None:
    assert closures.with_closures([(0.3, 0.5)], [0.25, 0.5], 1) == [(0.3, 0.5), (0.5, 0)]


def test_a_line_is_listened_to_where_it_sounds(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dubbing.speech import labials

    monkeypatch.undo()
    heard: list[int] = []

    def count(blocks: Any, words: str) -> list[labials.Labial]:
        heard.append(sum(map(len, blocks())))
        return [labials.Labial("p", 0.2), labials.Labial("m", 0.4)]

    monkeypatch.setattr(labials, "labials", count)
    cue: Cue = load(path).dubs["it"].cues[0]
    lengths = np.full((cue.stop - cue.first, 7), 0.1)

    class Half:
        def lips(self, of: Cue, edit: Edit, strength: Any = None) -> np.ndarray:
            return lengths if strength is None else np.full_like(lengths, 0.02)

    assert closures.closures_of(cue, Half()) == [0.2, 0.4]  # type: ignore[arg-type]
    assert heard == [round(cue.seconds * 16000)]
    lengths[11] = 0.025  # beside the frame of .4 s the lips touch already
    assert closures.closures_of(cue, Half()) == [0.2]  # type: ignore[arg-type]
    lengths[11] = 0.05
    assert closures.closures_of(cue, Half()) == [0.2, 0.4]  # type: ignore[arg-type]


def test_without_words_there_is_nothing_to_do(path: Path) -> None:
    clips.write_sound(path.parent / "alone.wav", 1)
    text = path.read_text()
    path.write_text(text[: text.index("  - ")] + "  - {identity: ann, audio: alone.wav}\n")
    with pytest.raises(ExplainedError, match="the words of no line are known"):
        [*closures.write_closures(load(path))]


def test_edits_in_the_manifest_are_left_alone(path: Path) -> None:
    path.write_text(path.read_text().replace("track.wav}", "track.wav, edits: []}"))
    with pytest.raises(ExplainedError, match="move them to it"):
        [*closures.write_closures(load(path))]
