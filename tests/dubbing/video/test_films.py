"""Films of many kinds are dubbed, or refused: the table of docs/development/films.md.

`python -m tests.dubbing.video.test_films` writes it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dubbing import media
from dubbing.engine.disk.numbered import options_of, with_options
from dubbing.manifest.checks.film_checks import of_picture
from dubbing.manifest.keys.findings import Findings
from dubbing.media import PixelFormat
from dubbing.mixing.sound import Sound
from dubbing.script.timeline import Cue
from dubbing.video.assembly import make
from dubbing.video.heads import Heads, read_heads
from dubbing.video.own_pixels import reasons, views
from dubbing.video.settings import VideoSettings
from dubbing.workshop.lab.results import filled
from tests import clips, fakes

pytestmark = pytest.mark.medium

FRAMES, WINDOW = 8, (40, 12, 32)
DOCUMENT = Path(__file__).parents[3] / "docs/development/films.md"
MARKS = "<!-- made by tests/dubbing/video/test_films.py -->", "<!-- end of what it made -->"
SPACES = {"smpte2084": "PQ", "arib-std-b67": "HLG", "bt2020-10": "BT.2020", "smpte432": "P3"}


@dataclass(frozen=True)
class Film:
    """A film that is made, as ffmpeg's options say, and what its dub is.

    Attributes:
        made: options of the encoder. codec: of the dub. kept: whether the dub is of that size,
            with all that is not replaced bit for bit. colour: what the manifest says of it.
    """

    name: str
    made: str
    codec: str = "ffv1"
    rate: str = "25"
    size: tuple[int, int] = (96, 64)
    timecode: str = ""
    kept: bool = True
    colour: str = ""


def tagged(transfer: str, primaries: str = "bt2020", matrix: str = "bt2020nc") -> str:
    """Options of the encoder of a film in a colour space of its own."""
    tags = f"colorspace={matrix}:color_primaries={primaries}:color_trc={transfer}"
    return f"-vf scale=out_color_matrix=bt2020,format=yuv420p10le,setparams={tags}"


PQ, HLG = tagged("smpte2084"), tagged("arib-std-b67")
DNXHR = "-c:v dnxhd -profile:v dnxhr_hqx -pix_fmt yuv422p10le"
HEVC = "-c:v libx265 -pix_fmt yuv420p10le -x265-params log-level=none"
MASTERING = "G(13250,34500)B(7500,3000)R(34000,16000)WP(15635,16450)L(10000000,1)"
PRORES4444 = "-c:v prores_ks -profile:v 4444 -pix_fmt yuv444p10le"
FILMS = [
    Film("h264_8.mp4", "-c:v libx264 -pix_fmt yuv420p"),
    Film("h264_10.mp4", "-c:v libx264 -pix_fmt yuv420p10le", rate="24000/1001"),
    Film("h264_422_10.mov", "-c:v libx264 -pix_fmt yuv422p10le", rate="30000/1001"),
    Film("h264_full.mp4", "-c:v libx264 -pix_fmt yuvj420p -color_range pc"),
    Film("hevc_10.mp4", HEVC, rate="50"),
    Film("hevc_12.mkv", "-c:v libx265 -pix_fmt yuv420p12le -x265-params log-level=none"),
    Film("prores.mov", "-c:v prores_ks -profile:v hq", rate="24", timecode="01:00:00:00"),
    Film("prores4444.mov", PRORES4444),
    Film("dnxhr.mov", DNXHR, size=(256, 128)),
    Film(
        "rgb.mxf",
        "-c:v dnxhd -profile:v dnxhr_444 -pix_fmt gbrp10le",
        "ffv1",
        "25",
        (256, 128),
        "01:00:00:00",
    ),
    Film("alpha.mov", "-vf format=yuva444p10le -c:v prores_ks -profile:v 4444"),
    Film("ffv1_422_12.mkv", "-c:v ffv1 -pix_fmt yuv422p12le", rate="24000/1001"),
    Film("cineform.mov", "-c:v cfhd -pix_fmt gbrp12le", size=(256, 128)),
    Film("ffv1_8.mkv", "-c:v ffv1 -pix_fmt yuv444p"),
    Film("ffv1_16.mkv", "-c:v ffv1 -pix_fmt yuv444p16le"),
    Film("ffv1_rgb16.mkv", "-c:v ffv1 -pix_fmt gbrp16le"),
    Film("ffv1_grey.mkv", "-c:v ffv1 -pix_fmt gray10le"),
    Film("mpeg2.ts", "-c:v mpeg2video -q:v 2"),
    Film("b_frames.avi", "-c:v libx264 -bf 2", rate="30000/1001"),
    Film("mjpeg.avi", "-c:v mjpeg -q:v 2"),
    Film("vp9.webm", "-c:v libvpx-vp9 -lossless 1", rate="60000/1001"),
    Film("bt2020.mkv", f"-c:v ffv1 {tagged('bt2020-10')}"),
    Film("p3.mkv", f"-c:v ffv1 {tagged('bt709', 'smpte432')}"),
    Film("odd.mkv", "-c:v ffv1 -pix_fmt yuv420p", size=(97, 65)),
    Film("drop.mov", "-c:v libx264", rate="30000/1001", timecode="01:00:59;28"),
    Film("half.mov", "-c:v libx264", rate="60000/1001", timecode="01:00:00:10"),
    Film("to_hevc.mp4", HEVC, "hevc"),
    Film("to_prores.mov", "-c:v prores_ks -profile:v hq", "prores", timecode="10:00:00:00"),
    Film("to_4444.mov", PRORES4444, "prores4444"),
    Film("pq.mkv", f"-c:v ffv1 {PQ}"),
    Film("pq_p3.mkv", f"-c:v ffv1 {tagged('smpte2084', 'smpte432')} -pix_fmt yuv444p12le"),
    Film("pq_rgb.mkv", "-c:v ffv1 -vf format=gbrp12le,setparams=color_trc=smpte2084"),
    Film("pq_to_hevc.mp4", f"{HEVC}:max-cll=1000,400:master-display={MASTERING} {PQ}", "hevc"),
    Film("pq_to_prores.mov", f"-c:v prores_ks -profile:v hq {PQ}", "prores", "24"),
    Film("pq_to_dnxhr.mov", f"{DNXHR} {PQ}", "dnxhr", size=(256, 128)),
    Film("hlg.mov", f"{HEVC} {HLG}", "prores4444", "50"),
    Film("hlg_to_hevc.mp4", f"{HEVC} {HLG}", "hevc", "60000/1001"),
    Film("logc4.mov", PRORES4444, "prores4444", "24", colour="LogC4"),
    Film("slog3.mkv", "-c:v ffv1 -pix_fmt yuv422p10le", colour="S-Log3 S-Gamut3.Cine"),
    Film("vlog.mov", f"{HEVC} -color_range pc", "hevc", colour="V-Log"),
    Film("turned.mp4", "-c:v libx264", size=(96, 80), kept=False),
    Film("wide.mp4", "-c:v libx264 -vf setsar=4/3", size=(96, 96), kept=False),
]
REFUSED = {
    "fields.mp4": ("-vf interlace -flags +ilme+ildct -x264-params tff=1", "is interlaced"),
}


def write(folder: Path, name: str, made: str, film: Film) -> Path:
    frames = clips.write_video(
        folder / "frames.mkv", FRAMES, Fraction(film.rate), size=film.size, pixels="bgr0"
    )
    sound = clips.write_sound(folder / "sound.wav", float(FRAMES / Fraction(film.rate)), 48000)
    start = ["-timecode", film.timecode] if film.timecode else []
    heard: list[str | Path] = [] if name.endswith(".webm") else ["-i", sound, "-c:a", "pcm_s16le"]
    if name.endswith((".mp4", ".ts")):
        heard[-1:] = ["aac" if name.endswith(".mp4") else "mp2"]
    path = folder / name
    clips.ffmpeg("-i", frames, *heard, *made.split(), *start, path)
    if name.startswith("turned"):
        path.rename(folder / "upright.mp4")
        clips.ffmpeg("-display_rotation", "90", "-i", folder / "upright.mp4", "-c", "copy", path)
    return path


def dubbed(folder: Path, clip: Path, codec: str) -> Path:
    info = media.probe(clip)
    prepared = fakes.write_prepared(clip, folder / "prepared", window=WINDOW)
    frames, rate = info.frames, info.rate
    fakes.write_heads(folder / "heads", frames, rate)
    audio = clips.write_sound(folder / "a.wav", float(frames / rate) + 0.1, 48000)
    kept = reasons(prepared, views(prepared))
    return make(
        [Heads(partial(read_heads, folder / "heads"), prepared, 0, frames, kept)],
        Sound((Cue("it", 0, frames, audio, 0.0, float(frames / rate)),)),
        folder / "out",
        pose_index=np.arange(frames),
        settings=VideoSettings(codec=codec, label=False),
        progress=lambda _message, _share: None,
    )


def tolerance(codec: str, pixels: PixelFormat) -> float:
    """Code values by which a codec may change a plane on average."""
    return 0.0 if codec == "ffv1" else 1.5 * (1 << max(0, pixels.bits - 8))


@pytest.mark.parametrize("film", FILMS, ids=lambda film: film.name)
def test_a_film_is_kept(tmp_path: Path, film: Film) -> None:
    clip = write(tmp_path, film.name, film.made, film)
    clip = with_options(clip, {"film": film.colour} if film.colour else {})
    before = media.probe(clip)
    assert bool(before.values.film) == any(
        [film.colour, *(name in film.made for name in ("smpte2084", "arib-std-b67"))]
    )
    result = dubbed(tmp_path, clip, film.codec)
    after = media.probe(result)
    assert (after.rate, after.frames) == (before.rate, FRAMES)
    assert after.full_timecode_at(0) == before.full_timecode_at(0)
    assert bool(before.timecode) == bool(film.timecode)
    assert replace(after.colour, matrix="", full_range=False) == replace(
        before.colour, matrix="", full_range=False
    )
    assert bool(after.colour.mastering) == ("master-display" in film.made)
    exact = media.SOUND[film.codec] != "aac"  # which is written in packets of 1,024
    samples, room = len(media.read_audio(result, rate=48000)), 0 if exact else 1024
    assert abs(samples - round(FRAMES / before.rate * 48000)) <= room
    shown = with_options(result, options_of(clip))
    numbers = [clips.number(frame) for frame in media.read_frames(shown)]
    if film.name.startswith("turned"):
        assert (after.width, after.height) == film.size[::-1]
        return
    assert numbers == list(range(FRAMES))
    if not film.kept:
        assert (after.width, after.height) == (128, 96)
        return
    assert (after.width, after.height) == film.size
    made = media.read_planes(result, pixels=before.pixels)
    for own, new in zip(media.read_planes(clip), made, strict=True):
        changed = 0
        for one, other in zip(own, new, strict=True):
            left = WINDOW[0] * one.shape[1] // before.width
            apart = np.abs(one.astype(np.int64) - other)
            changed += int((apart[:, left:] > 0).sum())
            assert apart[:, :left].mean() <= tolerance(film.codec, before.pixels)
        assert changed > 0


def row(film: Film) -> list[str]:
    """Cells of the table."""
    pixels = re.search(r"(?:-pix_fmt |format=)(\w+)", film.made)
    encoder = re.search(r"-c:v (\S+)", film.made)
    space = [word for name, word in SPACES.items() if name in film.made]
    kept = "equal" if film.codec == "ffv1" else "a mean of 1.5 levels of 8 bits at most"
    return [
        f"`{film.name}`",
        encoder[1] if encoder else "",
        pixels[1] if pixels else "",
        film.rate,
        "x".join(map(str, film.size)),
        film.timecode,
        film.colour or ", ".join(space),
        f"`{film.codec}`",
        kept if film.kept else "other pixels: see delivery",
    ]


def table() -> list[str]:
    """The table of the document."""
    names = "film", "encoder", "pixels", "rate", "size", "timecode", "colour", "dub", "outside"
    refused = [
        f"| `{name}` |{' |' * 6} refused | {words} |" for name, (_, words) in REFUSED.items()
    ]
    rows = [f"| {' | '.join(row(film))} |".replace("  ", " ") for film in FILMS]
    return [f"| {' | '.join(names)} |", "|---" * len(names) + "|", *rows, *refused]


def test_the_document_has_this_table() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    assert filled(text, MARKS, table()) == text


@pytest.mark.parametrize("name", REFUSED)
def test_a_film_is_refused(tmp_path: Path, name: str) -> None:
    options, words = REFUSED[name]
    clip = write(tmp_path, name, options, Film(name, options))
    findings = Findings()
    of_picture(findings, "ann", media.probe(clip), ("identities", "ann", "clip"))
    assert words in findings.problems[0][1]


if __name__ == "__main__":
    written = filled(DOCUMENT.read_text(encoding="utf-8"), MARKS, table())
    DOCUMENT.write_text(written, encoding="utf-8")
