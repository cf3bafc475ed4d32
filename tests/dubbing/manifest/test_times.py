"""Times in a manifest: seconds, or as a clock shows them."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.identity_entry import Identity
from tests import clips
from tests.dubbing.manifest.made import GOOD, problems, read


def test_a_dub_begins_with_a_frame_that_there_is(folder: Path) -> None:
    """75 frames at 25 a second: frame 74 is at 2.96 s, and times are rounded to the next frame."""
    for start, fits in ((2.97, True), (2.99, False)):
        text = GOOD.replace("audio: it.wav", f"audio: it.wav, video_start: {start}")
        if fits:
            read(folder, text)
        else:
            (message,) = problems(folder, text)
            assert message.startswith("line 6: dubs[0].video_start: 2.99 s is past the end")


@pytest.mark.parametrize(
    ("written", "seconds"),
    [
        ("1:05", 65),
        ('"1:05"', 65),
        ("01:05", 65),
        ("0:01", 1),
        ("0:30.5", 30.5),
        ("1:05.25", 65.25),
        ("90:00", 5400),
        ("1:02:03", 3723),
        ("00:00:01.5", 1.5),
        ("65", 65),
    ],
)
def test_a_time_is_read_as_a_clock_shows_it(folder: Path, written: str, seconds: float) -> None:
    keys = ("start", "seconds", "audio_start", "audio_seconds", "video_start")
    text = "\n".join(f"{key}: {written}" for key in keys)
    values = yaml_lines.read(text + "\nclip: host.mp4\nname: a\naudio: it.wav").data
    values |= {"identity": "host", "consent": {"by": "host", "reference": "form"}}
    for model in (Identity, Dub):
        entry = {key: values[key] for key in model.model_fields if key in values}
        found = model.model_validate(entry, context={"folder": folder})
        read_off = [getattr(found, key) for key in keys if key in model.model_fields]
        assert read_off == [seconds] * len(read_off)
        assert len(read_off) > 1


@pytest.mark.parametrize("key", ["start", "seconds"])
@pytest.mark.parametrize("written", ["1:65", "1:5", "01:00:05:12", "-1:05", "1:60:00", "1:05:"])
def test_another_time_is_refused(folder: Path, key: str, written: str) -> None:
    text = GOOD.replace("seconds: 2", f"{key}: {written!r}")
    (message,) = problems(folder, text)
    assert message == (
        f"line 4: identities.host.{key}: must be seconds as 65.5, or a time as 1:05.5 or "
        f"0:01:05.5, not {written!r}"
    )


def test_only_a_time_is_read_in_sixties(folder: Path) -> None:
    (message,) = problems(folder, GOOD.replace("seconds: 2", "seed: 1:05"))
    assert "identities.host.seed: must be a valid integer, not '1:05'" in message


def test_seconds_without_end(folder: Path) -> None:
    (message,) = problems(folder, GOOD.replace("seconds: 2", "seconds: 1.0e+308"))
    assert message.startswith("line 4: identities.host.seconds: must be above 0 and at most 1e+09")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("0", "must be above 0"),
        ("-1.5", "must be above 0"),
        (".nan", "must be above 0"),
        ("true", "must be a number of seconds or 'best', not True"),
        ("good", "must be a number of seconds or 'best', not 'good'"),
        ("[3]", "must be a number of seconds or 'best'"),
    ],
)
def test_what_is_no_number_of_seconds_to_learn_from(
    folder: Path, written: str, message: str
) -> None:
    (problem,) = problems(folder, GOOD.replace("seconds: 2", f"seconds: {written}"))
    assert problem.startswith(f"line 4: identities.host.seconds: {message}")


def test_the_best_seconds_are_looked_for_in_all_clips(folder: Path) -> None:
    clips.write_clip(folder / "longer.mp4", 100)
    best = GOOD.replace("seconds: 2", "seconds: best")
    several = best.replace("clip: host.mp4", "clips: [host.mp4, longer.mp4]")
    several = several.replace("audio: it.wav", "audio: it.wav, clip: host.mp4")
    host = read(folder, several).people["host"]
    assert [clip.path.name for clip in host.learned] == ["longer.mp4", "host.mp4"]
    assert (host.start, host.seconds) == (None, 15.0)
    assert read(folder, GOOD).people["host"].start == 0.0
    (problem,) = problems(folder, best.replace("seconds: best", "start: 0.5, seconds: best"))
    assert "identities.host.start: leave it out" in problem


def test_a_clip_shorter_than_requested_is_used_whole_with_a_warning(folder: Path) -> None:
    manifest = read(folder, GOOD.replace("seconds: 2", "seconds: 20"))
    assert any("learns from 3.0 s" in warning for warning in manifest.warnings)
