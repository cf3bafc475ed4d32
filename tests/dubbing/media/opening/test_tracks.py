"""Which tracks of a file are seen and heard."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.media.opening.opening import opened
from tests import clips

pytestmark = pytest.mark.medium


RATE = 48000
SOUNDS = (440, 1000, 1700)  # Hz of the tracks


def film(path: Path, tracks: str, *options: str, seconds: tuple[float, ...] = (1, 1, 1)) -> Path:
    """A film with a track of a tone for each letter, m(ono) or s(tereo)."""
    inputs: list[str] = []
    for hertz, length, _ in zip(SOUNDS, seconds, tracks, strict=False):
        inputs += ["-f", "lavfi", "-i", f"sine={hertz}:r={RATE}:d={length}"]
    maps = ["-map", "0:v"]
    for k, kind in enumerate(tracks):
        maps += ["-map", f"{k + 1}:a", f"-ac:a:{k}", "2" if kind == "s" else "1"]
    picture = ("-f", "lavfi", "-i", "testsrc2=s=64x48:r=25:d=1")
    codec = "mp2" if path.suffix == ".ts" else "pcm_s16le"
    clips.ffmpeg(*picture, *inputs, *maps, "-c:v", "mpeg2video", "-c:a", codec, *options, path)
    return path


def tones(path: Path) -> list[int]:
    """The loudest tone of every channel, Hz."""
    info = media.probe(path)
    blocks = media.iter_channels(path, rate=RATE, channels=info.audio_channels or 0)
    sound = np.concatenate(list(blocks))
    part = sound[RATE // 4 : 3 * RATE // 4]
    return [int(2 * k) for k in np.abs(np.fft.rfft(part, axis=0)).argmax(0)]


def flags(*given: str) -> list[str]:
    return [word for k, one in enumerate(given) for word in (f"-disposition:a:{k}", one)]


LATER = flags("0", "default")
HANDLERS = ["-metadata:s:a:1", "handler_name=Commentary"]
TITLES = ["-metadata:s:a:1", "title=Director's commentary"]
CASES = {
    "the default one, a later one": ("ss", LATER, [1000, 1000], 1),
    "the default one, of one channel": ("mm", LATER, [1000], 1),
    "several defaults, the first is a commentary": (
        *("ss", flags("default+comment", "default"), [1000, 1000], 1),
    ),
    "left and right": ("mm", [], [440, 1000], 0),
    "left and right, all default": ("mm", flags("default", "default"), [440, 1000], 0),
    "left and right, none default": ("mm", flags("0", "0"), [440, 1000], 0),
    "a commentary beside one channel": ("mm", TITLES, [440], 1),
    "a commentary by its flag": ("mm", flags("default", "comment"), [440], 1),
    "two languages": (
        *("mm", ["-metadata:s:a:0", "language=eng", "-metadata:s:a:1", "language=ita"]),
        *([440], 1),
    ),
    "stereo beside single channels": ("smm", [], [440, 440], 2),
    "three channels": ("mmm", [], [440, 1000, 1700], 0),
}


# ffmpeg writes no names and no commentary flags into QuickTime.
WRITTEN = [(case, ".mkv") for case in CASES]
WRITTEN += [(case, ".mov") for case in CASES if "commentary" not in case]


@pytest.mark.parametrize(("case", "suffix"), WRITTEN)
def test_the_tracks_that_are_heard(tmp_path: Path, case: str, suffix: str) -> None:
    tracks, options, heard, others = CASES[case]
    path = film(tmp_path / f"film{suffix}", tracks, *options)
    info = media.probe(path)
    assert (tones(path), info.unheard_tracks) == (heard, others)
    assert info.audio_channels == len(heard)
    out = tmp_path / "out.mkv"  # ... and so it goes into a result
    media.mux(path, path, out, audio_start=0.1, seconds=0.8, audio_codec="flac")
    assert tones(out) == heard


def test_a_film_whose_file_begins_with_a_cover(tmp_path: Path) -> None:
    """As of a shop, with its tags before its tracks."""
    plain, cover = clips.write_clip(tmp_path / "a.mp4", 10), tmp_path / "cover.png"
    path = tmp_path / "film.mp4"
    clips.ffmpeg("-f", "lavfi", "-i", "color=red:s=32x32", "-frames:v", "1", cover)
    maps = ("-map", "0", "-map", "1", "-c", "copy", "-disposition:v:1", "attached_pic")
    clips.ffmpeg("-i", plain, "-i", cover, *maps, path)
    content = path.read_bytes()
    tags, track = content.rindex(b"udta") - 4, content.index(b"trak") - 4
    end = tags + int.from_bytes(content[tags : tags + 4], "big")
    assert end == len(content)
    path.write_bytes(content[:track] + content[tags:] + content[track:tags])
    with opened(path) as container:
        assert [video.width for video in container.streams.video] == [32, 64]
    assert [clips.number(frame) for frame in media.read_frames(path)] == list(range(10))
    media.proxy(path, tmp_path / "proxy.mp4", {})
    assert media.probe(tmp_path / "proxy.mp4").frames == 10


def test_a_commentary_by_the_name_of_its_track(tmp_path: Path) -> None:
    assert tones(film(tmp_path / "film.mov", "mm", *HANDLERS)) == [440]


def test_single_channels_in_a_transport_stream_keep_their_places(tmp_path: Path) -> None:
    path = film(tmp_path / "film.ts", "mm", "-output_ts_offset", "7")
    assert media.probe(path).zero is not None
    assert tones(path) == [440, 1000]


def test_a_shorter_channel_ends_in_silence(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mov", "mm", seconds=(1, 0.5))
    sound = np.concatenate(list(media.iter_channels(path, rate=RATE, channels=2)))
    assert len(sound) == RATE
    late = sound[-RATE // 3 :]
    assert np.abs(late[:, 0]).max() > 0.1
    assert not late[:, 1].any()
