"""Assembly of the video: heads onto the film, the mark, the encoder, the sound, and a last check.

Frames stream from the decoders through the compositor to the encoder, in segments of their own
files, so memory does not grow with the length and a kill costs one segment. S side of the crop.
"""

import shutil
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import asdict
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from dubbing import media
from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.disk.numbered import with_options
from dubbing.engine.disk.pieces import Pieces
from dubbing.engine.graph.stage import Progress
from dubbing.media.reading.overlap import ahead, behind
from dubbing.mixing.mix import mix
from dubbing.mixing.sound import SOUND, Sound
from dubbing.preparation.crops.threads import in_order
from dubbing.provenance import provenance
from dubbing.video.composer import Composer
from dubbing.video.files import (
    DELIVERED,
    PICTURE_FILE,
    PROXY_FILE,
    SCENE_FILE,
    options_of_video,
    video_file,
)
from dubbing.video.found_mark import found_again, found_before
from dubbing.video.heads import Heads
from dubbing.video.settings import VideoSettings
from dubbing.video.spans import spans
from dubbing.video.turnover import CHECKED, Delivery
from dubbing.video.untouched import Proof, prove
from dubbing.video.verification import as_before, verify

SEGMENT = 25  # frames a file: what is made again where one of them changes
SUFFIX = ".mov"  # a container with exact time stamps and colours, to be joined without decoding
MIXED = "mixed.json"


def make(
    heads: Sequence[Heads],
    sound: Sound,
    out: Path,
    *,
    pose_index: np.ndarray,
    settings: VideoSettings,
    progress: Progress,
    proven: bool = True,
    made_by: str = "",
    last: Path | None = None,
) -> Path:
    """Write OUT/video.<suffix>: composited, marked, encoded, with its sound; checked by decoding.

    Where there is to be a card of credits it follows the last frame, in silence.

    It has the colours of the film, and its timecode. What no browser plays gets OUT/proxy.mp4.
    OUT/picture.json says where faces stay the film's own, where something lies over them, how much
    of each cue is dubbed, and whether the invisible mark is found in the finished file. Frames that
    are delivered beside it lie in OUT/delivered.

    Frames without new speech are the film's own. Where voices are mixed there is also
    OUT/voices.flac, and OUT/scene.json: how loud it is, and what proves that.

    Args:
        heads: of all cues; their clips are of one film.
        pose_index: (F,) frame of the film under every frame of the dub.
        proven: whether frames of a scene without new speech are compared with the film.
        made_by: digest of film, people, settings and code.
        last: folder of the last result, of which segments are taken that are made of the same.

    Raises:
        MediaError: a file broke off, or ffmpeg failed.
        RenderingError: fewer heads than frames, or the finished file is not what it should be.
    """
    result = video_file(out, settings.codec)
    segments = out / "segments"
    film, card = heads[0].clip, settings.card
    rate = film.rate
    frames = len(pose_index) + (card.frames if card else 0)
    source = media.probe(film.clip)
    delivery = None
    if settings.deliver != "video":
        delivery = Delivery(film.clip, out / DELIVERED, settings.deliver == "sequence")
    composer = Composer(heads, pose_index, settings, delivery)
    taken = np.zeros(len(pose_index), bool)
    if not result.exists():
        if delivery is None:  # frames beside the video are made with their segment
            taken = _take_over(composer, segments, Pieces(out, last, made_by), settings.codec)
        parts = _pictures(composer, segments, taken, settings, progress)
        progress("muxing", 1.0)
        # The sound has its requested length, unless the dub was cut to the clip.
        longest = float((len(pose_index) + Fraction(1, 2)) / rate)
        if (cue := sound.recording) is not None:
            heard, start, seconds = cue.audio, cue.audio_start, min(cue.seconds, longest)
        else:
            atomic_write_json(out / MIXED, mix(sound, film.clip, out))
            heard, start, seconds = out / SOUND, 0.0, float(len(pose_index) / rate)
        media.mux(
            parts,
            heard,
            result,
            audio_start=start,
            seconds=seconds,
            silent_until=float(frames / rate) if card else None,
            audio_codec=media.SOUND[settings.codec],
            audio_rate=settings.audio_rate,
            metadata=provenance.tags(),
            timecode=source.full_timecode_at(int(pose_index[0])),
        )
    progress("decoding the result", 1.0)
    own, seen = composer.untouched(), np.zeros(frames, bool)
    if last is not None:
        seen[: len(own)] = as_before(result, video_file(last, settings.codec), taken)
    proven = proven and (out / MIXED).is_file() and bool(own.any())
    settled = seen.copy()
    settled[: len(own)] |= own & proven  # the comparison decodes these
    verify(result, frames, rate, settled)
    proof = Proof(untouched=None, parts={})
    if proven:
        progress("comparing with the film", 1.0)
        before = json_records.read_or(None, last / SCENE_FILE, Proof) if last else None
        proof = prove(film.clip, result, own, rate, SEGMENT, before, seen[: len(own)])
    picture: dict[str, Any] = {
        "own_pixels": composer.own_pixels(),
        "overlaid": composer.overlaid(),
        "reach": {cue: asdict(reach) for cue, reach in composer.reach().items()},
    }
    if settings.mark is not None:
        progress("looking for the invisible mark", 1.0)
        shown = composer.replaced()
        known = found_before(last, taken, shown[0], rate)
        picture["mark"] = known or found_again(result, settings.mark, *shown, rate)
    if delivery is not None:
        picture["delivered"] = delivery.finish(rate)
    atomic_write_json(out / PICTURE_FILE, picture)
    (out / CHECKED).unlink(missing_ok=True)
    if settings.codec != "h264":
        progress("proxy", 1.0)
        shown_as = with_options(result, options_of_video(film.clip, settings.frame))
        media.proxy(shown_as, out / PROXY_FILE, provenance.tags())
    if (out / MIXED).is_file():
        figures = json_records.read(out / MIXED, dict[str, Any], "figures of the mix")
        atomic_write_json(out / SCENE_FILE, {"sound": figures, **proof})
        (out / SOUND).unlink(missing_ok=True)
        (out / MIXED).unlink()
    shutil.rmtree(segments, ignore_errors=True)
    return result


def segment_edges(frames: int) -> list[tuple[int, int]]:
    """First frame and stop of every segment of so many frames."""
    return [(first, min(first + SEGMENT, frames)) for first in range(0, frames, SEGMENT)]


def _file_of(folder: Path, first: int, stop: int) -> Path:
    """The file of frames first .. stop."""
    return folder / f"{first:06d}-{stop:06d}{SUFFIX}"


def _take_over(composer: Composer, folder: Path, pieces: Pieces, codec: str) -> np.ndarray:
    """Cut the segments that would be made again from the last result, if it has exact times.

    Those that follow one another become one file. Gives their frames, (F,) bool.
    """
    exact = media.SUFFIX[codec] != ".mkv"
    taken = np.zeros(len(composer.poses), bool)
    for first, stop in segment_edges(len(taken)):
        (same,) = pieces.same(f"{first:06d}", [[first, composer.made_of(first, stop)]])
        taken[first:stop] = same and exact and not _file_of(folder, first, stop).exists()
    if pieces.last is not None and taken.any():
        for first, stop in spans(taken):
            file = _file_of(folder, first, stop)
            if not file.exists():
                media.cut(video_file(pieces.last, codec), file, first, stop - first)
    return taken


def _pictures(
    composer: Composer,
    folder: Path,
    taken: np.ndarray,
    settings: VideoSettings,
    progress: Progress,
) -> list[tuple[Path, Fraction]]:
    """Encode the frames, then the card of credits: files with their lengths in seconds.

    Args:
        taken: see `_take_over`.
    """
    rate, poses = composer.film.rate, composer.poses
    frames = len(poses)

    def writer(part: Path) -> media.VideoWriter:
        return media.VideoWriter(
            part, *composer.size, rate, settings.codec, composer.colour, composer.pixels
        )

    def finished(first: int, stop: int) -> Generator[np.ndarray | media.Planes]:
        films = zip(composer.planes(first, stop), composer.read(first, stop), strict=True)
        with closing(ahead(films)) as read:
            jobs = ((own, *of, int(poses[k]), k) for k, (own, of) in enumerate(read, first))
            yield from in_order(composer.frame, jobs)

    edges = [edge for edge in segment_edges(frames) if not taken[edge[0]]]
    edges = sorted([*edges, *spans(taken)])
    parts = [(_file_of(folder, first, stop), (stop - first) / rate) for first, stop in edges]
    missing = np.array([k for k, (part, _) in enumerate(parts) if not part.exists()], int)
    for run in np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1):
        if not len(run):
            continue
        with closing(finished(edges[run[0]][0], edges[run[-1]][1])) as made:
            for k in run:
                first, stop = edges[k]
                encoder = writer(parts[k][0])
                with encoder, behind(encoder.write) as write:
                    for done, picture in enumerate(islice(made, stop - first), first):
                        write(picture)
                        progress("compositing", done / frames)
    if settings.card is not None:
        part = folder / f"card{SUFFIX}"
        parts.append((part, settings.card.frames / rate))
        picture = composer.card(settings.card.text)
        with writer(part) as encoder:
            for _ in range(settings.card.frames):
                encoder.write(picture)
    return parts
