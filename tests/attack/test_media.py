"""Clips and recordings that are damaged, of another kind, or pass for what they are not."""

from __future__ import annotations

import contextlib
import functools
import json
import struct
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dubbing import media
from dubbing.errors import ExplainedError
from tests import clips
from tests.attack import rule
from tests.attack.conftest import Room
from tests.attack.odd import cases, damaged
from tests.attack.test_manifests import WHOLE

pytestmark = pytest.mark.medium


CONTAINERS = ("mp4", "mov", "mkv", "avi", "ts", "mpg", "ogg", "flv", "nut", "webm", "wav", "flac")
SUFFIXES = (*CONTAINERS, "mp3", "m3u8", "txt", "gif", "yaml", "sdp", "")
LISTS = (
    "ffconcat version 1.0\nfile {there}\n",
    "ffconcat version 1.0\nfile 'http://127.0.0.1:9/x'\n",
    "#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:1,\n{there}\n#EXT-X-ENDLIST\n",
    "#EXTM3U\n#EXTINF:1,\nfile://{there}\n#EXT-X-ENDLIST\n",
    '<?xml version="1.0"?><MPD><Period><BaseURL>{there}</BaseURL></Period></MPD>',
    "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nm=video 9 RTP/AVP 96\n",
    "[playlist]\nFile1={there}\n",
    "RTSPtextRTSP://127.0.0.1:9/x\n",
    "a line of text\n" * 50,
    "\x1b[2J\x1b[31mred",
)
RATES = (0, 1, 7, 4000, 8000, 44099, 48000, 192000, 2**31, 2**32 - 1)
CHANNELS = (0, 1, 2, 3, 8, 9, 64, 65, 255, 65535)
BITS = (0, 1, 7, 8, 12, 16, 24, 32, 64, 65535)
FLOAT = 3  # the format of a WAV whose samples are floats
SAMPLES = (b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f", b"\xff\xff\x7f\x7f", b"\x00\x00\x00\x00")


@functools.cache
def whole(suffix: str) -> bytes:
    """A second of film with sound in a container; sound alone where it takes no film."""
    with tempfile.TemporaryDirectory() as folder:
        clip, out = Path(folder) / "clip.mp4", Path(folder) / f"out.{suffix}"
        clips.write_clip(clip, 26)
        if suffix == "mp4":
            return clip.read_bytes()
        codecs = {
            **dict.fromkeys(("mkv", "mov", "ts", "nut"), ("-c", "copy")),
            "webm": ("-c:v", "libvpx", "-c:a", "libopus"),
        }
        rate = ("-ar", "44100") if suffix == "flv" else ()
        clips.ffmpeg("-i", clip, *codecs.get(suffix, ()), *rate, out)
        return out.read_bytes()


def wav(rate: int, channels: int, bits: int, kind: int, sound: bytes) -> bytes:
    """A WAV whose header says what it likes."""
    width = channels * bits // 8
    about = struct.pack("<HHIIHH", kind, channels, rate, rate * width % 2**32, width % 2**16, bits)
    return (
        b"RIFF\xff\xff\xff\x7fWAVEfmt \x10\0\0\0"
        + about
        + b"data"
        + struct.pack("<I", len(sound))
        + sound
    )


wavs = st.builds(
    wav,
    st.sampled_from(RATES),
    st.sampled_from(CHANNELS),
    st.sampled_from(BITS),
    st.sampled_from((1, 2, FLOAT, 6, 0x55, 0xFFFE, 0xFFFF)),
    st.sampled_from((b"", b"x", b"\x01" * 9999))
    | st.sampled_from(SAMPLES).map(lambda s: s * 24000),
)
films = st.sampled_from(CONTAINERS).flatmap(lambda suffix: damaged(whole(suffix)))
lists = st.sampled_from(LISTS)
pieces = st.binary(max_size=200) | st.sampled_from(
    (b"\0" * 5000, b"GIF89a", b"ID3\3", b"OggS" * 99)
)


def plan_with(folder: Path, name: str, key: str) -> Path:
    """A manifest that uses a file as the clip or as the sound."""
    data: dict[str, Any] = json.loads(json.dumps(WHOLE))
    entry = data["identities"]["ann"] if key == "clip" else data["dubs"][0]
    entry[key] = name
    (folder / "m.yaml").write_text(json.dumps(data))
    return folder / "m.yaml"


def planned(kind: str, room: Room, content: bytes, suffix: str, key: str) -> None:
    with room() as folder:
        (folder / f"x.{suffix}").write_bytes(content)
        path = plan_with(folder, f"x.{suffix}", key)
        rule.judge(kind, folder, "plan", path, reads_only=True)
        # What a stage would do with it: pictures and sound, or an error of ours.
        with contextlib.suppress(ExplainedError):
            info = media.probe(folder / f"x.{suffix}")
            if info.frames and info.width <= 256:
                for _ in zip(media.read_frames(info.path), range(40), strict=False):
                    pass
        with contextlib.suppress(ExplainedError):
            media.read_audio(folder / f"x.{suffix}")


keys = st.sampled_from(("clip", "audio"))


@given(films, st.sampled_from(SUFFIXES), keys)
@cases(50)
def test_damaged_films(room: Room, film: bytes, suffix: str, key: str) -> None:
    planned("media: damaged", room, film, suffix, key)


@given(wavs, st.sampled_from(("wav", "mp4")))
@cases(40)
def test_sounds_of_odd_rates_channels_and_samples(room: Room, sound: bytes, suffix: str) -> None:
    planned("media: odd WAV", room, sound, suffix, "audio")


@given(lists, st.sampled_from(SUFFIXES), keys)
@cases(20)
def test_texts_that_name_other_files(room: Room, text: str, suffix: str, key: str) -> None:
    with room() as folder:
        (folder / "list").write_text(text.format(there=folder / "ann.mp4"))
        (folder / f"x.{suffix}").write_bytes((folder / "list").read_bytes())
        path = plan_with(folder, f"x.{suffix}", key)
        rule.judge("media: playlists", folder, "plan", path, reads_only=True)
        with contextlib.suppress(ExplainedError):  # at most a text is taken for raw sound
            assert not media.probe(folder / f"x.{suffix}").frames
            assert not media.read_audio(folder / f"x.{suffix}").any()


@given(pieces, st.sampled_from(SUFFIXES), keys)
@cases(20)
def test_what_is_no_film(room: Room, content: bytes, suffix: str, key: str) -> None:
    planned("media: no film", room, content, suffix, key)


@given(films | wavs | lists.map(str.encode) | pieces, st.sampled_from(("verify", "init", "sync")))
@cases(15)
def test_commands_that_take_any_film(room: Room, content: bytes, command: str) -> None:
    with room() as folder:
        if command == "init":
            (folder / "out").mkdir()
            (folder / "out" / "x.mp4").write_bytes(content)
            rule.judge("media: init", folder, "init", folder / "out")
        else:
            (folder / "x.mp4").write_bytes(content)
            rule.judge(f"media: {command}", folder, command, folder / "x.mp4", reads_only=True)


@pytest.mark.usefixtures("stand_ins")
@given(films | wavs, keys)
@cases(4)
def test_dubs_of_damaged_films(room: Room, content: bytes, key: str) -> None:
    with room() as folder:
        (folder / "x.mkv").write_bytes(content)
        rule.judge("media: dub", folder, "dub", plan_with(folder, "x.mkv", key))


def test_whole_films_are_taken(room: Room) -> None:
    """So that the cases above are refused for what was done to them."""
    for suffix in ("mp4", "mov", "mkv", "wav", "flac"):
        key = "audio" if suffix in ("wav", "flac") else "clip"
        with room() as folder:
            (folder / f"x.{suffix}").write_bytes(whole(suffix))
            ending = rule.call("plan", plan_with(folder, f"x.{suffix}", key))
            assert ending.code == 0, (suffix, ending.err)
            assert "8 to run" in ending.out, (suffix, ending.out)
