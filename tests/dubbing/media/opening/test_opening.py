"""Names that are addresses, texts that list files: nothing but the named file is ever opened."""

import ast
import os
import socket
import threading
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest

from dubbing import media
from dubbing.errors import ExplainedError, ManifestError, MediaError
from dubbing.manifest.init import write_manifest
from dubbing.media.opening import opening
from dubbing.sync.check import check
from tests import clips

pytestmark = pytest.mark.medium


DUBBING = Path(media.__file__).resolve().parents[1]


class Listener:
    """A local port that counts who comes, and answers nobody."""

    def __init__(self) -> None:
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self.calls = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                caller, _ = self._socket.accept()
            except OSError:
                return
            self.calls += 1
            caller.close()

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def listener(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Listener]:
    monkeypatch.chdir(tmp_path)
    found = Listener()
    yield found
    found.close()


NAMES = ("http:127.0.0.1:{port}", "tcp:127.0.0.1:{port}", "concat:real.mp4", "subfile,,x.mp4")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_never_an_address(listener: Listener, name: str) -> None:
    """A real clip of such a name, given by a relative path, is read like any other."""
    real = clips.write_clip(Path("real.mp4"), 30)
    path = Path(name.format(port=listener.port))
    real.rename(path)
    assert media.probe(path).frames == media.count_frames(path) == 30
    assert [clips.number(f) for f in media.read_frames(path, start=28)] == [28, 29]
    assert len(media.read_audio(path)) > 0
    media.mux(path, path, "out.mp4", audio_start=0, seconds=1.2)
    assert media.count_frames("out.mp4") == 30
    assert listener.calls == 0


def test_what_is_no_clip_sends_nothing_either(listener: Listener) -> None:
    for name in NAMES:
        path = Path(name.format(port=listener.port))
        path.write_text("no media")
        for reads in (media.probe, media.count_frames, check, lambda p: next(media.read_frames(p))):
            with pytest.raises(ExplainedError):
                reads(path)
        with pytest.raises(ExplainedError):
            media.mux(path, path, "out.mp4", audio_start=0, seconds=1)
    with pytest.raises(ManifestError):
        write_manifest(Path())
    assert listener.calls == 0


@pytest.mark.parametrize("codec", ["h264", "ffv1"])
def test_an_output_of_such_a_name_is_a_file(listener: Listener, codec: str) -> None:
    folder = Path(f"tcp:127.0.0.1:{listener.port}")
    folder.mkdir()
    sound = clips.write_sound(Path("a.wav"), 1)
    for path in (Path(f"tcp:127.0.0.1:{listener.port}.mkv"), folder / "out.mkv"):
        part = clips.write_video(path, 20, codec=codec)
        media.mux([(part, Fraction(20, 25))], sound, folder / "o.mkv", audio_start=0, seconds=0.8)
        assert media.probe(folder / "o.mkv").frames == 20
    assert listener.calls == 0


def playlists(clip: Path) -> dict[str, str]:
    """Texts by the name of their file; each opens a clip beside it, or a series, or draws text."""
    return {
        "concat.mp4": f"ffconcat version 1.0\nfile '{clip}'\n",
        "hls.m3u8": f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{clip}\n#EXT-X-ENDLIST\n",
        "sdp.mp4": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\n"
        "m=video 18771 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
        "series%03d.png": "any",
        "notes.nfo": "some text\n" * 50,
        "notes.txt": "some text\n" * 50,
    }


@pytest.mark.parametrize("name", list(playlists(Path("x"))))
def test_what_opens_other_files_is_refused(tmp_path: Path, name: str) -> None:
    clip = clips.write_clip(tmp_path / "real.ts", 10)
    clips.ffmpeg("-i", clip, "-vf", "scale=32:32", tmp_path / "series%03d.png")
    path = tmp_path / name
    path.write_text(playlists(clip)[name])
    for reads in (media.probe, media.count_frames):
        with pytest.raises(MediaError, match=r"(?s)playlist.*" + name + r".*convert it"):
            reads(path)
    with pytest.raises(MediaError):
        media.mux(path, path, tmp_path / "out.mp4", audio_start=0, seconds=1)


def test_what_people_film_and_record_with_is_read(tmp_path: Path) -> None:
    clip = clips.write_clip(tmp_path / "real.mkv", 75)
    for name in ("a.mp4", "a.mov", "a.avi", "a.ts", "a.mpg", "a.webm", "a.flv", "a.wmv", "a.nut"):
        clips.ffmpeg("-i", clip, "-s", "320x240", "-cpu-used", "8", tmp_path / name)
        assert media.probe(tmp_path / name).frames >= 74, name
    for name in ("b.wav", "b.mp3", "b.m4a", "b.flac", "b.ogg", "b.opus", "b.aiff", "b.caf", "b.wv"):
        clips.ffmpeg("-i", clip, "-vn", tmp_path / name)
        assert media.probe(tmp_path / name).sound_seconds > 2.9, name


def test_the_list_of_parts_holds_one_file_a_line(tmp_path: Path) -> None:
    folder = tmp_path / "a\nfile b"
    part = clips.write_video(folder / "v.mp4", 5)
    sound = clips.write_sound(tmp_path / "a.wav", 1)
    with pytest.raises(MediaError, match="line break"):
        media.mux([(part, Fraction(1, 5))], sound, tmp_path / "o.mp4", audio_start=0, seconds=1)


def test_a_name_that_is_no_text_is_reported(tmp_path: Path) -> None:
    clip = clips.write_video(tmp_path / "v.mp4", 5)
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.mp4"))
    clip.rename(path)
    with pytest.raises(MediaError, match=r"not valid UTF-8.*rename it") as caught:
        media.probe(path)
    str(caught.value).encode()  # can be printed
    with pytest.raises(MediaError, match="not valid UTF-8"):
        clips.write_video(path, 5)


@pytest.mark.parametrize("path", sorted(DUBBING.rglob("*.py")), ids=lambda p: p.stem)
def test_only_this_module_opens_files(path: Path) -> None:
    """Only ``opening.py`` opens with PyAV, names inputs of ffmpeg or reads video with cv2."""
    if path == Path(opening.__file__).resolve():
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        at = f"{path.name}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Import):
            assert all(name.name.split(".")[0] != "ffmpeg" for name in node.names), at
        elif isinstance(node, ast.ImportFrom):
            assert (node.module or "").split(".")[0] not in ("ffmpeg", "av"), at
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            assert ast.unparse(node.func) not in ("av.open", "av.container.open"), at
            assert node.func.attr not in ("VideoCapture", "output", "overwrite_output"), at
