"""Warnings of a manifest about sounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing.errors import ManifestError
from dubbing.manifest.manifest import load
from tests import clips

RATE = 16000
SRT = "1\n00:00:00,400 --> 00:00:01,000\nANN: One.\n\n2\n00:00:01,400 --> 00:00:02,000\nANN: Two.\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sounds")
    clips.write_clip(place / "film.mp4", 75)
    tone = clips.tone(3)
    sounds = {
        "plain.wav": tone,
        "opposed.wav": np.hstack([tone, -tone]),
        "left.wav": np.hstack([tone, 0 * tone]),
        "half.wav": np.vstack([tone[: round(1.2 * RATE)], 0 * tone]),
        "silent.wav": 0 * tone,
        "ten.wav": np.repeat(tone, 10, 1),
        "long.wav": clips.tone(3.04),
        "short.wav": clips.tone(2),
    }
    for name, samples in sounds.items():
        soundfile.write(place / name, samples, RATE)
    soundfile.write(place / "loud.wav", 8 * tone / np.abs(tone).max(), RATE, subtype="FLOAT")
    soundfile.write(place / "full.wav", tone / np.abs(tone).max(), RATE, subtype="FLOAT")
    for name in ("opposed", "silent", "ten"):
        codec = ("-c:v", "copy", "-c:a", "pcm_s16le")
        maps = ("-map", "0:v", "-map", "1:a")
        film, sound = place / "film.mp4", place / f"{name}.wav"
        clips.ffmpeg("-i", film, "-i", sound, *maps, *codec, place / f"{name}.mov")
    film, tone_file = place / "film.mp4", place / "plain.wav"
    both = ("-map", "0:v", "-map", "1:a", "-map", "1:a", "-c:v", "copy", "-c:a", "pcm_s16le")
    clips.ffmpeg("-i", film, "-i", tone_file, *both, place / "two.mov")
    later = ("-disposition:a:0", "0", "-disposition:a:1", "default")
    clips.ffmpeg("-i", film, "-i", tone_file, *both, *later, place / "later.mov")
    seen = ("-map", "0:v", "-map", "0:v", "-map", "1:a", "-c:v", "copy", "-c:a", "pcm_s16le")
    clips.ffmpeg("-i", film, "-i", tone_file, *seen, place / "angles.mov")
    priming = ("-af", "asetpts=PTS+1024")  # else the picture begins later
    clips.ffmpeg("-i", film, "-c:v", "mpeg4", "-c:a", "aac", *priming, place / "old.avi")
    clips.ffmpeg("-i", place / "plain.wav", "-t", "2.5", place / "raw.aac")
    (place / "it.srt").write_text(SRT)
    return place


def warnings(folder: Path, dub: str, clip: str = "film.mp4") -> list[str]:
    path = folder / "m.yaml"
    who = f"{{clip: {clip}, seconds: 1, consent: {clips.CONSENT}}}"
    path.write_text(
        f"version: 1\noutput: out\nidentities:\n  ann: {who}\ndubs:\n  - {{name: it, {dub}}}\n"
    )
    return [w for w in load(path).warnings if "nothing is held out" not in w]


SCENE = "lines: it.srt, speakers: {ANN: ann}, audio: "
WHOLE = "identity: ann, audio: "
ONE = "channel 1 is heard as the voice"
CASES = [
    (WHOLE + "plain.wav", "film.mp4", []),
    (SCENE + "plain.wav", "film.mp4", []),
    (WHOLE + "opposed.wav", "film.mp4", ["the 2 channels of opposed.wav cancel one another", ONE]),
    (SCENE + "opposed.wav", "film.mp4", ["the 2 channels of opposed.wav cancel one another", ONE]),
    (SCENE + "left.wav", "film.mp4", ["the 2 channels of left.wav are silent in part", ONE]),
    (WHOLE + "plain.wav", "opposed.mov", ["identities.ann: the 2 channels of opposed.mov", ONE]),
    (WHOLE + "silent.wav", "film.mp4", ["it: nothing can be heard in", "silent.wav"]),
    (WHOLE + "loud.wav", "film.mp4", ["it: loud.wav is up to 18.1 dB above full scale, and is"]),
    (SCENE + "loud.wav", "film.mp4", ["it: loud.wav is up to 18.1 dB above full scale, and is"]),
    (SCENE + "loud.wav, loudness: r128", "film.mp4", []),
    (SCENE + "full.wav", "film.mp4", []),
    (SCENE + "half.wav", "film.mp4", ["nothing can be heard in the sound of lines 2: mouths"]),
    (WHOLE + "plain.wav", "two.mov", ["two.mov: tracks 1, 2 of 2 are heard as the channels"]),
    (WHOLE + "plain.wav", "angles.mov", ["angles.mov: of its 2 video tracks number 1 alone is"]),
    (WHOLE + "plain.wav", "old.avi", ["old.avi: AAC in an AVI, or by itself, may be late"]),
    (WHOLE + "raw.aac", "film.mp4", ["raw.aac: AAC in an AVI, or by itself, may be late"]),
    (WHOLE + "plain.wav", "later.mov", ["later.mov: of its 2 tracks of sound number 2 alone"]),
    (
        WHOLE + "long.wav",
        "film.mp4",
        [
            "0.04 s longer than the film: the film's last shot runs backwards and forwards",
            "1 frame",
        ],
    ),
    (SCENE + "plain.wav, music_effects: long.wav", "film.mp4", []),
    (
        SCENE + "plain.wav, music_effects: short.wav",
        "film.mp4",
        ["it: short.wav lasts 2.00 s, the film 3.00 s: is it of the same cut?"],
    ),
    (WHOLE + "plain.wav, video_start: 1.0", "film.mp4", ["1.00 s longer", "last 25 frames"]),
    (WHOLE + "long.wav, on_longer_audio: loop", "film.mp4", ["the film begins again"]),
    (WHOLE + "long.wav, on_longer_audio: hold", "film.mp4", ["the film's last picture stands"]),
    (WHOLE + "long.wav, on_longer_audio: cut", "film.mp4", ["what is longer, 1 frame, is cut off"]),
]


@pytest.mark.parametrize(("dub", "clip", "expected"), CASES)
def test_a_plan_says_what_is_heard(folder: Path, dub: str, clip: str, expected: list[str]) -> None:
    found = warnings(folder, dub, clip)
    assert len(found) == (1 if expected else 0)
    assert all(part in found[0] for part in expected)


@pytest.mark.parametrize(
    ("dub", "clip", "message"),
    [
        (WHOLE + "plain.wav", "silent.mov", "nothing can be heard in .*silent.mov"),
        (SCENE + "plain.wav", "ten.mov", "10 channels in .*ten.mov: a scene takes 8 at most"),
        (SCENE + "plain.wav, music_effects: ten.wav, codec: prores", "film.mp4", "10 channels"),
    ],
)
def test_what_cannot_be_is_refused(folder: Path, dub: str, clip: str, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        warnings(folder, dub, clip)
