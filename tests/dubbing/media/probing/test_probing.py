from fractions import Fraction
from pathlib import Path

import pytest
import soundfile

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.properties.frame_rate import choose_rate
from tests import clips


@pytest.mark.parametrize("rate", [Fraction(24000, 1001), Fraction(25), Fraction(30)])
@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov"])
def test_rate_and_frames_are_exact(tmp_path: Path, rate: Fraction, suffix: str) -> None:
    info = media.probe(clips.write_video(tmp_path / f"clip{suffix}", 31, rate))
    assert (info.rate, info.frames, info.variable_rate) == (rate, 31, False)
    assert (info.width, info.height) == (64, 48)
    assert info.audio_rate is None
    assert info.duration == pytest.approx(31 / float(rate))


def test_sound_alone(tmp_path: Path) -> None:
    info = media.probe(clips.write_sound(tmp_path / "a.wav", 1.25, 44100, 2))
    assert (info.frame_rate, info.frames, info.width) == (None, 0, 0)
    assert (info.audio_rate, info.audio_channels) == (44100, 2)
    assert info.sound_seconds == pytest.approx(1.25)


def test_a_clip_with_dropped_frames_keeps_the_rate_it_was_filmed_at(tmp_path: Path) -> None:
    whole = clips.write_video(tmp_path / "whole.mp4", 60, Fraction(30))
    torn = tmp_path / "torn.mkv"
    # Every seventh and every eighth frame are missing; the others keep their times.
    keep = "select='mod(n,7)*mod(n,8)'"
    clips.ffmpeg("-i", whole, "-vf", keep, "-fps_mode", "passthrough", "-c:v", "ffv1", torn)
    info = media.probe(torn)
    assert info.variable_rate
    assert info.rate == 30
    shown = [clips.number(f) for f in media.read_frames(torn)]
    assert len(shown) == info.frames
    # Where a frame is missing the one before it stays on screen; time is kept to the end.
    kept = [k for k in range(60) if k % 7 and k % 8]
    offset = min(kept)
    for k, seen in enumerate(shown):
        nearest = max((v for v in kept if v <= k + offset), default=min(kept))
        assert abs(seen - nearest) <= 1, (k, seen, nearest)


def test_rotation_is_honoured(tmp_path: Path) -> None:
    plain = clips.write_video(tmp_path / "plain.mp4", 3)
    turned = tmp_path / "turned.mp4"
    clips.ffmpeg("-display_rotation", "90", "-i", plain, "-c", "copy", turned)
    info = media.probe(turned)
    assert (info.width, info.height) == (48, 64)
    assert next(media.read_frames(turned)).shape == (64, 48, 3)


def test_cover_art_is_no_picture(tmp_path: Path) -> None:
    sound, cover = clips.write_sound(tmp_path / "a.wav", 1), tmp_path / "cover.png"
    clips.ffmpeg("-f", "lavfi", "-i", "color=red:s=32x32", "-frames:v", "1", cover)
    song = tmp_path / "song.m4a"
    maps = ("-map", "0", "-map", "1", "-c:v", "copy", "-disposition:v", "attached_pic")
    clips.ffmpeg("-i", sound, "-i", cover, *maps, song)
    assert media.probe(song).picture is None
    with pytest.raises(MediaError, match="no picture in it"):
        _ = media.probe(song).rate


@pytest.mark.parametrize("content", [b"", b"hello", bytes(5000)])
def test_what_is_no_media_is_reported(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.mp4"
    path.write_bytes(content)
    with pytest.raises(MediaError, match=r"broken\.mp4"):
        media.probe(path)


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(MediaError, match="no such file"):
        media.probe(tmp_path / "nothing.mp4")


def test_choose_rate_bears_jitter_but_not_gaps() -> None:
    times = [k / 25 + 0.005 * (-1) ** k for k in range(50)]
    assert choose_rate(times, [Fraction(25)]) == (25, False)
    assert choose_rate(times[:20] + times[21:], [Fraction(25)]) == (25, True)
    # A Matroska file knows milliseconds only.
    rounded = [round(k * 1001 / 24) / 1000 for k in range(50)]
    assert choose_rate(rounded, []) == (Fraction(24000, 1001), False)


def test_frames_that_are_all_displayed_at_once_are_reported(tmp_path: Path) -> None:
    plain, still = clips.write_video(tmp_path / "plain.mp4", 5), tmp_path / "still.mkv"
    clips.ffmpeg("-i", plain, "-c", "copy", "-bsf:v", "setts=ts=0", still)
    with pytest.raises(MediaError, match=r"the same time stamp \(.*still\.mkv\): convert"):
        media.probe(still)
    # Most at once, and the last of them far away.
    assert choose_rate([0.0, 0.0, 0.0, 1e5], []) == (10, True)


def test_a_file_that_was_cut_off_is_reported(tmp_path: Path) -> None:
    whole = clips.write_clip(tmp_path / "whole.mp4", 60).read_bytes()
    (tmp_path / "torn.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MediaError, match=r"breaks off: \d+ of 60 frames"):
        media.probe(tmp_path / "torn.mp4")


@pytest.mark.parametrize(
    "name", ["film.mkv", "voice.wav", "voice.aiff", "voice.flac", "big.wav", "voice.mka"]
)
def test_half_of_a_file_whose_header_has_its_length_is_reported(tmp_path: Path, name: str) -> None:
    clip, whole = clips.write_clip(tmp_path / "clip.mp4", 100), tmp_path / name
    only_sound = () if name == "film.mkv" else ("-vn",)
    codecs = {".aiff": "pcm_s16be", ".flac": "flac"}
    codec = ("-c:a", codecs.get(whole.suffix, "pcm_s16le"))
    large = ("-rf64", "always") if name == "big.wav" else ()
    clips.ffmpeg("-i", clip, *only_sound, *codec, *large, whole)
    assert media.probe(whole).sound_seconds == pytest.approx(4, abs=0.1)
    content = whole.read_bytes()
    whole.write_bytes(content[: len(content) // 2])
    with pytest.raises(MediaError, match=rf"it breaks off: .* are there \(.*{name}\): copy"):
        media.probe(whole)


@pytest.mark.parametrize("faststart", [(), ("-movflags", "+faststart")])
def test_frames_that_an_edit_list_leaves_out_do_not_lack(
    tmp_path: Path, faststart: tuple[str, ...]
) -> None:
    """As of a film that was trimmed, or moved against its sound, without encoding it anew."""
    plain, path = clips.write_video(tmp_path / "plain.mkv", 80, codec="ffv1"), tmp_path / "a.mp4"
    encoded = tmp_path / "encoded.mp4"
    clips.ffmpeg("-i", plain, "-c:v", "libx264", "-g", "10", "-pix_fmt", "yuv420p", encoded)
    clips.ffmpeg("-itsoffset", "-0.8", "-i", encoded, "-c", "copy", *faststart, path)
    assert media.probe(path).frames == 60
    assert [clips.number(frame) for frame in media.read_frames(path)] == list(range(20, 80))
    if faststart:
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        with pytest.raises(MediaError, match=r"breaks off: \d+ of \d\d frames"):
            media.probe(path)


@pytest.mark.parametrize("size", [0, 0x7FFFFFFF, 0xFFFFFFFF])
def test_a_streamed_wave_file_is_whole(tmp_path: Path, size: int) -> None:
    """Its length was not known when its header was written."""
    path = tmp_path / "a.wav"
    clips.ffmpeg("-i", clips.write_clip(tmp_path / "clip.mp4", 50), "-vn", "-bitexact", path)
    content = bytearray(path.read_bytes())
    for at in (4, content.index(b"data") + 4):
        content[at : at + 4] = size.to_bytes(4, "little")
    path.write_bytes(content)
    assert media.probe(path).sound_seconds == pytest.approx(2, abs=0.1)


def test_a_broadcast_that_begins_between_key_frames_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.ts"
    clips.ffmpeg("-i", clips.write_clip(tmp_path / "clip.mp4", 50), "-c", "copy", path)
    content = path.read_bytes()
    path.write_bytes(content[len(content) // 3 // 188 * 188 :])
    with pytest.raises(MediaError, match=r"first frames cannot be decoded.*a\.ts\): convert"):
        media.probe(path)


@pytest.mark.parametrize("name", ["film.ts", "film.mpg", "voice.ogg"])
def test_files_joined_byte_by_byte_are_reported(tmp_path: Path, name: str) -> None:
    """As parts of a disc: both were read in one time, as a film of half the length."""
    path, clip = tmp_path / name, clips.write_clip(tmp_path / "clip.mp4", 50)
    clips.ffmpeg("-i", clip, *(("-vn",) if name == "voice.ogg" else ()), path)
    assert media.probe(path).duration == pytest.approx(2, abs=0.1)
    path.write_bytes(2 * path.read_bytes())
    with pytest.raises(
        MediaError, match=r"its time stamps begin anew after [12]\.\d s, as of several files"
    ):
        media.probe(path)


@pytest.mark.parametrize("offset", ["-3", "-0.5"])
def test_frames_without_time_stamps_are_reported(tmp_path: Path, offset: str) -> None:
    """Matroska knows no negative times: a part of the frames would be dropped."""
    plain, negative = clips.write_video(tmp_path / "plain.mp4", 150), tmp_path / "negative.mkv"
    shift = ("-output_ts_offset", offset, "-avoid_negative_ts", "disabled")
    clips.ffmpeg("-i", plain, "-c", "copy", *shift, negative)
    with pytest.raises(MediaError, match=r"of its 150 frames have no time.*negative\.mkv.*convert"):
        media.probe(negative)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), 1e20])
@pytest.mark.parametrize("kind", [("FLOAT", ".wav"), ("DOUBLE", ".wav"), ("FLOAT", ".aiff")])
def test_sound_that_is_no_number_is_reported(
    tmp_path: Path, wrong: float, kind: tuple[str, str]
) -> None:
    wave = clips.tone(2.0, channels=2).astype(float)
    path = tmp_path / f"a{kind[1]}"
    soundfile.write(path, wave, 16000, subtype=kind[0])
    assert media.probe(path).sound_seconds == 2
    wave[-3, 1] = wrong
    soundfile.write(path, wave, 16000, subtype=kind[0])
    with pytest.raises(MediaError, match=r"not finite numbers.*export it again"):
        media.probe(path)


@pytest.mark.parametrize(
    ("size", "filters", "name"),
    [
        ("2x2", "null", "odd.mkv"),
        ("2x64", "null", "odd.mkv"),
        ("8000x16", "null", "odd.mkv"),
        ("320x240", "setsar=2000/1", "odd.mp4"),
    ],
)
def test_a_shape_that_nobody_films_is_reported(
    tmp_path: Path, size: str, filters: str, name: str
) -> None:
    path = tmp_path / name
    picture = ("-f", "lavfi", "-i", f"testsrc=s={size}", "-t", "0.2", "-vf", filters)
    codec = "ffv1" if path.suffix == ".mkv" else "libx264"
    clips.ffmpeg(*picture, "-c:v", codec, "-pix_fmt", "yuv444p", path)
    with pytest.raises(MediaError, match=r"px as displayed.*odd\.m.*times the other"):
        media.probe(path)


def test_a_sound_that_nothing_decodes_is_reported(tmp_path: Path) -> None:
    path = clips.write_sound(tmp_path / "a.wav", 0.1)
    content = bytearray(path.read_bytes())
    content[20:22] = b"\x99\x99"  # the format of its samples
    path.write_bytes(content)
    with pytest.raises(MediaError, match=r"cannot be decoded .*a\.wav.*convert it"):
        media.probe(path)


def test_sound_of_no_channels_is_reported(tmp_path: Path) -> None:
    path = clips.write_sound(tmp_path / "none.wav", 0.2)
    raw = bytearray(path.read_bytes())
    at = raw.index(b"fmt ") + 8
    raw[at : at + 2] = (85).to_bytes(2, "little")  # MP3 in a WAV, whose header says the channels
    raw[at + 2 : at + 4] = bytes(2)
    path.write_bytes(raw)
    with pytest.raises(MediaError, match=r"no channels, or no rate \(.*none\.wav\): export"):
        media.probe(path)


def test_a_whole_film_in_avi_is_whole_and_half_of_it_is_not(tmp_path: Path) -> None:
    """Its clock may tick faster than its frames come."""
    film, whole = clips.write_clip(tmp_path / "film.mp4", 40), tmp_path / "whole.avi"
    clips.ffmpeg("-i", film, "-c", "copy", whole)
    info = media.probe(whole)
    assert info.frames == pytest.approx(40, abs=1)
    assert info.rate == 25
    (tmp_path / "torn.avi").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(MediaError, match="breaks off"):
        media.probe(tmp_path / "torn.avi")
