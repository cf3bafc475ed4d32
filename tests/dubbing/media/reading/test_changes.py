"""Films whose picture or sound changes on the way: calls over a network, parts put together."""

import struct
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.errors import MediaError
from dubbing.media.probing.fields import looks_interlaced
from tests import clips

pytestmark = pytest.mark.medium
CHANGES = {  # filters and options of the frames from 28 on
    "size": ("scale=128:96",),
    "range": ("scale=out_range=pc", "-color_range", "pc"),
    "chroma": ("format=yuv444p",),
    "matrix": ("setparams=colorspace=bt709",),
}


def changing(folder: Path, change: str) -> Path:
    """60 numbered frames, of which those from 28 on are encoded otherwise."""
    film, first, second, both = (folder / n for n in ("a.mkv", "1.h264", "2.h264", "b.h264"))
    clips.write_video(film, 60, codec="ffv1")
    encoder = ("-c:v", "libx264", "-crf", "8", "-bf", "0", "-pix_fmt")
    clips.ffmpeg("-i", film, "-frames:v", "28", *encoder, "yuv420p", first)
    filters, *options = CHANGES[change]
    pixels = "yuv444p" if change == "chroma" else "yuv420p"
    parted = f"trim=start_frame=28,setpts=PTS-STARTPTS,{filters}"
    clips.ffmpeg("-i", film, "-vf", parted, *encoder, pixels, *options, second)
    both.write_bytes(first.read_bytes() + second.read_bytes())
    clips.ffmpeg("-r", "25", "-f", "h264", "-i", both, "-c", "copy", folder / "film.ts")
    return folder / "film.ts"


@pytest.mark.parametrize("change", list(CHANGES))
def test_a_picture_that_changes_keeps_its_frames(tmp_path: Path, change: str) -> None:
    film = changing(tmp_path, change)
    assert (media.probe(film).width, media.probe(film).frames) == (64, 60)
    assert [clips.number(frame) for frame in media.read_frames(film)] == list(range(60))
    assert [clips.number(frame) for frame in media.read_frames(film, start=40)] == [*range(40, 60)]
    planes = list(media.read_planes(film))
    assert [clips.number(luma) for luma, *_ in planes] == list(range(60))
    means = [luma[8:].mean() for luma, *_ in planes]
    assert np.ptp(means) < 0.6  # of levels: with the range of the first frame
    assert not looks_interlaced(film)
    media.proxy(film, tmp_path / "proxy.mp4", {})
    shown = media.read_frames(tmp_path / "proxy.mp4")
    assert [clips.number(frame) for frame in shown] == list(range(60))


@pytest.mark.parametrize("change", [("-ac", "6"), ("-ar", "44100")])
def test_sound_that_changes_is_refused(tmp_path: Path, change: tuple[str, str]) -> None:
    """It was late from there on: by as much as it had lasted."""
    noise = clips.write_noise(tmp_path / "a.wav", 3)
    parts = tmp_path / "1.ac3", tmp_path / "2.ac3"
    clips.ffmpeg("-i", noise, "-ac", "2", parts[0])
    clips.ffmpeg("-i", noise, "-ac", "2", *change, parts[1])
    (tmp_path / "both.ac3").write_bytes(b"".join(part.read_bytes() for part in parts))
    clips.ffmpeg("-i", tmp_path / "both.ac3", "-c", "copy", tmp_path / "sound.ts")
    with pytest.raises(MediaError, match=r"its sound changes its channels or its rate on the way"):
        media.read_audio(tmp_path / "sound.ts")
    for block in media.iter_channels(parts[0], rate=48000, channels=2):
        assert block.shape[1] == 2


def test_a_film_put_together_by_an_edit_list_is_whole(tmp_path: Path) -> None:
    """Frames before a part, from its key frame on, are decoded and not shown: times go back."""
    plain, path = clips.write_video(tmp_path / "plain.mkv", 50, codec="ffv1"), tmp_path / "a.mp4"
    clips.ffmpeg("-i", plain, "-c:v", "libx264", "-bf", "0", "-pix_fmt", "yuv420p", path)
    content = bytearray(path.read_bytes())
    at = content.index(b"elst")
    each = int.from_bytes(content[at + 12 : at + 16], "big") // 50  # of the film's clock a frame
    parts = [(20, 0), (20, 30)]  # frames, from one on; of its own clock 512 a frame
    entries = b"".join(struct.pack(">IiI", n * each, first * 512, 1 << 16) for n, first in parts)
    content[at + 8 : at + 24] = len(parts).to_bytes(4, "big") + entries
    for box in (b"moov", b"trak", b"edts", b"elst"):
        start = content.index(box) - 4
        size = int.from_bytes(content[start : start + 4], "big") + len(entries) - 12
        content[start : start + 4] = size.to_bytes(4, "big")
    path.write_bytes(content)
    shown = [clips.number(frame) for frame in media.read_frames(path)]
    assert shown == [*range(20), *range(30, 50)]
