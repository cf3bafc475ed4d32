"""Where the sound of a scene comes from at every moment, and how loud it is."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from dubbing import media
from dubbing.mixing.mix import envelope, mix, with_dialogue
from dubbing.mixing.sound import SOUND, VOICES, Sound
from dubbing.mixing.voices import RATE, measured, placed
from dubbing.script.timeline import Cue
from tests import clips

pytestmark = pytest.mark.medium


FRAMES, FPS = 150, Fraction(25)
FILM, MUSIC, VOICE = 220.0, 401.0, 997.0  # Hz


def write(path: Path, hertz: float, seconds: float, channels: int = 1, level: float = 0.1) -> Path:
    at = np.arange(round(seconds * RATE)) / RATE
    wave = level * np.sin(2 * np.pi * hertz * at)
    soundfile.write(path, np.repeat(wave[:, None], channels, 1), RATE, subtype="FLOAT")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("mix")
    clips.write_clip(place / "film.mp4", FRAMES)  # 220 Hz
    write(place / "me.wav", MUSIC, 6, 2)
    write(place / "me51.wav", MUSIC, 6, 6)
    write(place / "voice.wav", VOICE, 6, level=0.02)
    return place


def cues(folder: Path) -> list[Cue]:
    voice = folder / "voice.wav"
    return [
        Cue("ann", 25, 50, voice, 1.0, 1.0),
        Cue("ann", 100, 137, voice, 0.0, 37 / 25, number=2),
    ]


def strength(samples: np.ndarray, hertz: float, start: float, stop: float) -> float:
    """Amplitude of a tone in a stretch of sound (samples,)."""
    part = samples[round(start * RATE) : round(stop * RATE)]
    at = np.arange(len(part)) / RATE
    return float(2 * abs(np.mean(part * np.exp(-2j * np.pi * hertz * at))))


def made(folder: Path, out: Path, **changes: object) -> tuple[np.ndarray, dict[str, object]]:
    out.mkdir(exist_ok=True)
    whole = Sound(tuple(cues(folder)), film_heard=True, **changes)  # type: ignore[arg-type]
    found = mix(whole, folder / "film.mp4", out)
    sound, rate = soundfile.read(out / SOUND, always_2d=True)
    assert (rate, len(sound)) == (RATE, FRAMES * RATE // 25)
    return sound, found


def test_the_films_own_sound_is_outside_of_the_cues(folder: Path, tmp_path: Path) -> None:
    sound, _ = made(folder, tmp_path)
    for start, stop, new in ((0, 0.98, 0), (1.01, 1.99, 1), (2.01, 3.98, 0), (4.01, 5.47, 1)):
        assert strength(sound[:, 0], FILM, start, stop) == pytest.approx(0.2 * (1 - new), abs=0.01)
        assert strength(sound[:, 0], VOICE, start, stop) == pytest.approx(0.02 * new, abs=0.001)
    voices, _ = soundfile.read(tmp_path / VOICES)
    assert not voices[: RATE - 10].any()
    assert voices[RATE + 240 : RATE + 480].any()  # it begins with its frame


def test_voices_over_music_and_those_left_alone(folder: Path, tmp_path: Path) -> None:
    left = ((60, 80), (110, 145))  # the second one overlaps a cue
    sound, _ = made(folder, tmp_path, music=folder / "me.wav", left=left)
    assert sound.shape[1] == 2
    for start, stop, own in ((0, 2.38, 0), (2.41, 3.18, 1), (3.21, 5.47, 0), (5.5, 5.79, 1)):
        for channel in sound.T:
            found = strength(channel, MUSIC, start, stop)
            assert found == pytest.approx(0.1 * (1 - own), abs=0.003)
    half = 0.02 / 2**0.5  # as loud in two loudspeakers as in one
    assert strength(sound[:, 1], VOICE, 1.01, 1.99) == pytest.approx(half, abs=0.001)


def test_dialogue_goes_to_the_centre(folder: Path, tmp_path: Path) -> None:
    sound, found = made(folder, tmp_path, music=folder / "me51.wav")
    assert found["channels"] == 6
    levels = [strength(channel, VOICE, 1.01, 1.99) for channel in sound.T]
    assert levels[2] == pytest.approx(0.02, abs=0.001)
    assert max(levels[:2] + levels[3:]) < 1e-4
    np.testing.assert_allclose(sound[:, 0], sound[:, 5], atol=1e-6)  # passed through
    assert strength(sound[:, 3], MUSIC, 0, 6) == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize(("loudness", "target"), [("r128", -23), ("streaming", -27)])
def test_every_cue_is_as_loud_as_requested(
    folder: Path, tmp_path: Path, loudness: str, target: float
) -> None:
    _, found = made(folder, tmp_path, music=folder / "me.wav", loudness=loudness)
    for cue in found["cues"]:  # type: ignore[attr-defined]
        assert cue["loudness"] == pytest.approx(target, abs=0.5)
    # ... and by ffmpeg itself, of the file
    stem = media.read_audio(tmp_path / VOICES, rate=RATE, start=1.0, seconds=1.0)
    assert measured(stem).integrated == pytest.approx(target, abs=0.5)


def test_true_peaks_are_held(folder: Path, tmp_path: Path) -> None:
    loud = write(tmp_path / "loud.wav", MUSIC, 6, 2, level=0.95)
    _, found = made(folder, tmp_path / "a", music=loud, loudness="r128")
    assert found["limited"]
    assert float(found["true_peak"]) <= -2.0  # type: ignore[arg-type]
    _, plain = made(folder, tmp_path / "b", music=loud)
    assert not plain["limited"]
    assert float(plain["true_peak"]) > -1  # type: ignore[arg-type]


def test_envelope_fades_inside() -> None:
    found = envelope([(1000, 3000), (3000, 4000)], 500, 5000)
    assert not found[:500].any()
    assert not found[3500:].any()
    assert found[500 + 240 : 2500 - 241].min() == 1
    pieces = [envelope([(1000, 3000), (3000, 4000)], 500 + k, 1000) for k in range(0, 5000, 1000)]
    np.testing.assert_array_equal(np.concatenate(pieces), found)


def test_dialogue_in_any_number_of_channels() -> None:
    voice = np.ones(4, np.float32)
    for channels in range(1, 9):
        power = (with_dialogue(np.zeros((4, channels), np.float32), voice) ** 2).sum(1)
        np.testing.assert_allclose(power, 1, rtol=1e-6)


def test_voices_lie_where_they_belong_to_the_sample(tmp_path: Path) -> None:
    rate = Fraction(30000, 1001)
    film = clips.write_clip(tmp_path / "film.mp4", 120, rate)
    voice = clips.write_noise(tmp_path / "voice.wav", 4)
    cues = (
        Cue("ann", 31, 60, voice, 0.75, float(29 / rate)),
        Cue("ann", 77, 113, voice, 2.0, float(36 / rate)),
    )
    mix(Sound(cues, film_heard=True), film, tmp_path)
    recording = media.read_audio(voice, rate=RATE)
    for name in (VOICES, SOUND):
        sound = soundfile.read(tmp_path / name, always_2d=True)[0][:, 0]
        for cue in cues:
            first, stop = (round(k * RATE / rate) for k in (cue.first, cue.stop))
            assert clips.lag(recording, sound[first:stop]) == round(cue.audio_start * RATE)


def test_opposed_channels_are_heard(folder: Path, tmp_path: Path) -> None:
    wave, _ = soundfile.read(folder / "voice.wav")
    soundfile.write(tmp_path / "opposed.wav", np.stack([wave, -wave], 1), RATE, subtype="FLOAT")
    cue = Cue("ann", 25, 50, tmp_path / "opposed.wav", 1.0, 1.0)
    sound = Sound((cue,), film_heard=True, loudness="r128")
    found = mix(sound, folder / "film.mp4", tmp_path)
    assert found["cues"][0]["loudness"] == pytest.approx(-23, abs=0.5)


@pytest.mark.parametrize(
    ("sound", "frames", "gain"),
    [
        ("voice.wav", 5, pytest.approx(13.7, abs=0.5)),  # 0.2 s alone, as the whole tone
        ("silent.wav", 25, 0.0),
    ],
)
def test_a_line_that_cannot_be_measured(
    folder: Path, tmp_path: Path, sound: str, frames: int, gain: float
) -> None:
    write(folder / "silent.wav", VOICE, 6, level=0)
    cue = Cue("ann", 25, 25 + frames, folder / sound, 1.0, frames / 25)
    (voice,) = placed([cue], FPS, "r128")
    assert voice.gain == gain
    loud = Cue("ann", 60, 85, write(tmp_path / "loud.wav", VOICE, 6, level=0.2), 0.0, 1.0)
    short, other = placed([cue, loud], FPS, "r128")
    assert short.gain == other.gain < 0


def test_two_mono_tracks_of_the_film_stay_both(folder: Path, tmp_path: Path) -> None:
    film = tmp_path / "film.mov"
    tones = [write(tmp_path / f"{hertz}.wav", hertz, 6) for hertz in (440, 1500)]
    inputs = ("-i", folder / "film.mp4", "-i", tones[0], "-i", tones[1])
    maps = ("-map", "0:v", "-map", "1:a", "-map", "2:a", "-c:v", "copy", "-c:a", "pcm_s16le")
    clips.ffmpeg(*inputs, *maps, film)
    mix(Sound(tuple(cues(folder)), film_heard=True), film, tmp_path)
    sound, _ = soundfile.read(tmp_path / SOUND, always_2d=True)
    for channel, own, other in ((0, 440, 1500), (1, 1500, 440)):
        assert strength(sound[:, channel], own, 2.1, 3.9) == pytest.approx(0.1, abs=0.003)
        assert strength(sound[:, channel], other, 2.1, 3.9) < 1e-4
        assert strength(sound[:, channel], own, 1.1, 1.9) < 1e-4
