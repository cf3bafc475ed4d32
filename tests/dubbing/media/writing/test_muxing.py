from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.writing.muxing import concat_list
from tests import clips

pytestmark = pytest.mark.medium


RATES = [Fraction(24000, 1001), Fraction(25), Fraction(30)]
HIGH = [Fraction(n, 1001) for n in (48000, 60000, 120000, 240000)]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize(("sound_rate", "channels"), [(8000, 1), (44100, 2)])
@pytest.mark.parametrize("wanted", [48000, None])
def test_picture_and_sound_begin_together(
    tmp_path: Path, rate: Fraction, sound_rate: int, channels: int, wanted: int | None
) -> None:
    video = clips.write_video(tmp_path / "v.mp4", 30, rate)
    sound = clips.write_sound(tmp_path / "a.wav", 3, sound_rate, channels)
    seconds = float(30 / rate)
    media.mux(video, sound, tmp_path / "o.mp4", audio_start=0.5, seconds=seconds, audio_rate=wanted)
    info = media.probe(tmp_path / "o.mp4")
    assert (info.rate, media.count_frames(tmp_path / "o.mp4")) == (rate, 30)
    assert (info.audio_rate, info.audio_channels) == (wanted or sound_rate, channels)
    assert info.video_start == info.audio_start == 0
    assert info.audio_duration == pytest.approx(seconds, abs=0.03)


@pytest.mark.parametrize("rate", [*RATES, *HIGH])
@pytest.mark.parametrize(
    "kind",
    [
        ("h264", ".mov", ".mp4", "aac"),
        ("prores", ".mov", ".mov", "pcm"),
        ("ffv1", ".nut", ".mkv", "flac"),
    ],
)
def test_parts_join_without_a_seam(
    tmp_path: Path, rate: Fraction, kind: tuple[str, str, str, str]
) -> None:
    codec, part, suffix, sound = kind
    parts, k = [], 0
    for name, length in (("it's 1", 13), ("2", 1), ("3", 166)):
        path = tmp_path / f"{name}{part}"
        with media.VideoWriter(path, 64, 48, rate, codec) as writer:
            for _ in range(length):
                writer.write(clips.frame(k))
                k += 1
        parts.append((path, length / rate))
    wave = clips.write_sound(tmp_path / "a.wav", 8)
    out = tmp_path / f"o{suffix}"
    media.mux(parts, wave, out, audio_start=0, seconds=float(180 / rate), audio_codec=sound)
    info = media.probe(out)
    assert (info.rate, info.variable_rate, media.count_frames(out)) == (rate, False, 180)
    assert abs(info.video_start - info.audio_start) < 1e-3
    assert [clips.number(f) for f in media.read_frames(out)] == list(range(180))


def test_no_bit_rate_is_guessed(tmp_path: Path) -> None:
    """Of parts ffmpeg guesses it now and then, so the same file would not come out twice."""
    part = clips.write_video(tmp_path / "part.mp4", 30, Fraction(25))
    sound = clips.write_sound(tmp_path / "a.wav", 2)
    out = tmp_path / "o.mp4"
    media.mux([(part, Fraction(30, 25))], sound, out, audio_start=0, seconds=1.2)
    assert b"btrt" in part.read_bytes()
    assert b"btrt" not in out.read_bytes()


def test_lengths_do_not_add_up_their_rounding() -> None:
    part = (Path("/x"), Fraction(1001, 24000))
    lengths = [float(line.split()[1]) for line in concat_list([part] * 999).splitlines()[2::2]]
    assert sum(lengths) == pytest.approx(999 * 1001 / 24000, abs=2e-6)


def test_sound_is_taken_from_where_it_was_requested(tmp_path: Path) -> None:
    import soundfile

    wave = np.zeros(3 * 16000, np.float32)
    wave[16000:16800] = 0.5  # a click at 1 s
    soundfile.write(tmp_path / "a.wav", wave, 16000)
    video = clips.write_video(tmp_path / "v.mov", 50)
    out = tmp_path / "o.mkv"
    media.mux(video, tmp_path / "a.wav", out, audio_start=0.75, seconds=2, audio_codec="flac")
    heard = media.read_audio(out)
    assert np.flatnonzero(np.abs(heard) > 0.25)[0] / 16000 == pytest.approx(0.25, abs=0.002)


@pytest.mark.parametrize("start", [0.0, 0.52, 1.2345])
@pytest.mark.parametrize(
    ("suffix", "codec", "given"),
    [(".mp4", "aac", 44100), (".mov", "pcm", 48000), (".mkv", "flac", 48000)],
)
def test_sound_lies_where_it_was_recorded_to_the_sample(
    tmp_path: Path, start: float, suffix: str, codec: str, given: int
) -> None:
    rate, frames = 48000, 40
    recording = clips.write_noise(tmp_path / "a.wav", 4, given)
    pictures = [(clips.write_video(tmp_path / "v.mov", frames), Fraction(frames, 25))]
    out = tmp_path / f"o{suffix}"
    media.mux(pictures, recording, out, audio_start=start, seconds=1.6, audio_codec=codec)
    heard, whole = (media.read_audio(path, rate=rate) for path in (out, recording))
    assert clips.lag(whole, heard[: round(1.6 * rate)]) == round(start * rate)
    with av.open(str(out)) as container:  # ... and its first picture is shown at 0
        assert [s.start_time for s in container.streams.video] == [0]


@pytest.mark.parametrize("channels", [9, 11, 16, 23, 64])
def test_a_proxy_of_many_channels(tmp_path: Path, channels: int) -> None:
    video = clips.write_video(tmp_path / "v.mov", 5, codec="prores")
    sound = clips.write_sound(tmp_path / "a.wav", 0.2, 48000, channels)
    film = tmp_path / "film.mov"
    media.mux(video, sound, film, audio_start=0, seconds=0.2, audio_codec="pcm")
    assert media.probe(film).audio_channels == channels
    media.proxy(film, tmp_path / "p.mp4", {})
    info = media.probe(tmp_path / "p.mp4")
    assert (info.audio_channels, info.frames) == (2, 5)
    assert np.abs(media.read_audio(tmp_path / "p.mp4")).max() > 0.1


@pytest.mark.parametrize("tracks", [1, 2])
def test_a_proxy_has_the_sound_that_is_read_as_loud(tmp_path: Path, tracks: int) -> None:
    """Of two mono tracks a browser would play the first, which may be an unused microphone."""
    video = clips.write_video(tmp_path / "v.mov", 25, codec="prores")
    voice, film = clips.write_sound(tmp_path / "a.wav", 1, 48000), tmp_path / "film.mov"
    silence = ("-f", "lavfi", "-i", "anullsrc=r=48000:cl=mono:d=1") if tracks == 2 else ()
    maps = [text for k in range(tracks + 1) for text in ("-map", str(k))]
    clips.ffmpeg("-i", video, *silence, "-i", voice, *maps, "-c:v", "copy", film)
    media.proxy(film, tmp_path / "p.mp4", {})
    with av.open(str(tmp_path / "p.mp4")) as container:
        assert len(container.streams.audio) == 1
    heard = np.stack([media.read_audio(path)[2000:14000] for path in (voice, tmp_path / "p.mp4")])
    assert np.ptp(heard.std(1)) < 0.01 * heard.std() + 0.0005


def test_chapters_of_a_recording_are_none_of_the_dub(tmp_path: Path) -> None:
    video, out = clips.write_video(tmp_path / "v.mp4", 25), tmp_path / "o.mp4"
    sound, listing = clips.write_sound(tmp_path / "a.wav", 2), tmp_path / "chapters.txt"
    listing.write_text(";FFMETADATA1\n[CHAPTER]\nTIMEBASE=1/10\nSTART=0\nEND=12\ntitle=one\n")
    told = tmp_path / "told.m4a"
    clips.ffmpeg("-i", sound, "-i", listing, "-map_metadata", "1", told)
    media.mux(video, told, out, audio_start=1, seconds=1)
    with av.open(str(told)) as recording, av.open(str(out)) as dub:
        assert (len(recording.chapters()), len(dub.chapters())) == (1, 0)


def test_sound_before_its_beginning_is_reported(tmp_path: Path) -> None:
    video = clips.write_video(tmp_path / "v.mp4", 5)
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    with pytest.raises(MediaError, match="before its beginning"):
        media.mux(video, sound, tmp_path / "o.mp4", audio_start=-0.5, seconds=0.2)
    with pytest.raises(MediaError, match="before its beginning"):
        media.read_audio(sound, start=-0.5)
    with pytest.raises(MediaError, match="frame -3 is before its beginning"):
        next(media.read_frames(video, start=-3))


def test_tags_are_written(tmp_path: Path) -> None:
    video = clips.write_video(tmp_path / "v.mp4", 5)
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    for suffix in (".mp4", ".mov", ".mkv"):
        out = tmp_path / f"o{suffix}"
        tags = {"comment": "made: by = a machine"}
        media.mux(video, sound, out, audio_start=0, seconds=0.2, metadata=tags)
        with av.open(str(out)) as container:
            tags = {key.lower(): value for key, value in container.metadata.items()}
        assert tags["comment"] == "made: by = a machine"
