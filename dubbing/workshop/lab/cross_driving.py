"""P15x: the case of a dub. Speech that was not learned from, over images from elsewhere.

Images (poses, background, the film's own jaw) are those of the learned seconds, and go through
the compositor of a dub. There is no true image, but the true lips of that speech are known.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np

from dubbing.engine.graph.stage import Progress
from dubbing.face.finding.landmarks import FaceMesh
from dubbing.heads import rendering as heads
from dubbing.heads.pose_refinement import refined
from dubbing.identity.best_seconds import Part
from dubbing.media import VideoWriter
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking import cropping
from dubbing.script import timeline
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.sync.network.sync_network import load_network
from dubbing.video import composer
from dubbing.workshop.lab import tiles
from dubbing.workshop.lab.chin import ChinFigures, chin_figures, chin_ratios
from dubbing.workshop.lab.measuring import first_of, write_csv
from dubbing.workshop.lab.mouth import MouthSeries

AT_ONCE = 250  # frames whose speech windows are held at a time


def frames_under(
    valid: np.ndarray, segment: np.ndarray, learned: Sequence[Part], count: int
) -> np.ndarray:
    """Which frames of the clip lie under `count` frames of speech, (count,).

    The longest stretch of one shot among the learned frames, all with a face, there and back.

    Args:
        valid, segment: (T,) of the clip.
    """
    frames = np.concatenate([np.arange(k, min(k + n, len(valid))) for k, n in learned])
    frames = frames[valid[frames]]
    breaks = np.flatnonzero((np.diff(frames) != 1) | (np.diff(segment[frames]) != 0)) + 1
    ends = [0, *breaks, len(frames)]
    first, stop = max(pairwise(ends), key=lambda ends: ends[1] - ends[0])
    return frames[first] + timeline.triangle(np.arange(count), stop - first)


def measure_dub(
    model: Path,
    clip: PreparedClip,
    speech: SpeechFrames,
    parts: list[Part],
    learned: Sequence[Part],
    out: Path,
    *,
    device: str = "auto",
    progress: Progress,
) -> dict[str, float]:
    """Dubs the learned images with other speech and compares the lips with those of that speech.

    Leaves OUT/frames.csv, OUT/tiles.png (the frame in which the speech was spoken, the dub, and the
    film's own frame under it), and the head crops of the first part: OUT/render_picture.mp4,
    OUT/source_picture.mp4.

    Args:
        model: a person's model.
        clip: of the person; speech: the audio at its frames.
        parts: frames whose speech is spoken; see `unlearned`.
        learned: frames that were learned from.
        out: folder.
        device: auto, cpu or cuda.

    Returns:
        The figures of `MouthSeries` and of `chin_ratios`, and `frames`, how many were dubbed.
    """
    out.mkdir(parents=True, exist_ok=True)
    total = sum(count for _, count in parts)
    under = frames_under(clip.valid, clip.segment, learned, total)
    finished = dubbed(model, clip, speech, parts, under, device, progress)
    mouths = MouthSeries(load_network().face.numpy(), float(clip.rate))
    rows: list[dict[str, float]] = []
    chins: list[ChinFigures] = []
    tile_rows: list[np.ndarray] = []
    done = 0
    dub_mesh = FaceMesh(tracking=True)
    true_mesh = FaceMesh(tracking=True)
    for number, (first, count) in enumerate(parts):
        with ExitStack() as files:
            videos = [
                files.enter_context(VideoWriter(path, clip.size, clip.size, clip.rate))
                for path in (out / "render_picture.mp4", out / "source_picture.mp4")
                if not number
            ]
            shot = None
            for k, (image, _, _) in enumerate(clip.frames(first, count), first):
                dub, film, index = next(finished)
                for video, pixels in zip(videos, (dub, image), strict=False):
                    video.write(pixels)
                if clip.segment[k] != shot:
                    true_mesh.restart()
                    shot = clip.segment[k]
                dubbed_face = first_of(dub_mesh(dub))
                true_face = first_of(true_mesh(image)) if clip.valid[k] else None
                mouth = mouths.add(k, dub, image, dubbed_face, true_face)
                chin = ChinFigures()
                if dubbed_face is not None:
                    chin = chin_figures(dub, film, dubbed_face[:, :2], clip.landmarks[index])
                chins.append(chin)
                rows.append({"frame": k, "under": index, **asdict(mouth), **asdict(chin)})
                if done in tiles.tile_frames(0, total):
                    tile_rows.append(np.concatenate([image, dub, film]))
                done += 1
                progress(f"P15x: frame {done} of {total}", done / total)
    write_csv(out / "frames.csv", rows)
    tiles.write_tiles(out, tile_rows)
    return {**mouths.figures(), **chin_ratios(chins), "frames": total}


def dubbed(
    model: Path,
    clip: PreparedClip,
    speech: SpeechFrames,
    parts: Iterable[Part],
    under: np.ndarray,
    device: str,
    progress: Progress,
) -> Iterator[tuple[np.ndarray, np.ndarray, int]]:
    """Head crops (S, S, 3) uint8 of finished frames and of the film's under them, and its number.

    Args:
        parts: frames whose speech is spoken. under: frame of the clip under each of them.
    """
    person, maps, _ = heads.load(model, device)
    posed = refined(person, maps, clip, np.unique(under), progress)
    index = np.zeros(len(clip), int)
    done = 0
    for first, count in parts:
        index[first : first + count] = under[done : done + count]
        done += count
        for start in range(first, first + count, AT_ONCE):
            stop = min(start + AT_ONCE, first + count)
            rendered = heads.frames(person, maps, posed, speech, index, start, stop, baked=True)
            films = composer.read_frames(clip, index[start:stop])
            for k, (colour, opacity), film in zip(
                index[start:stop].tolist(), rendered, films, strict=True
            ):
                head, seen = heads.to_rgba(colour, opacity), float(clip.valid[k])
                face = composer.Face(clip, film, head, seen)
                frame, _ = composer.with_faces(film.whole, [face], k)
                yield cropping.crop(frame, clip.crop[k], clip.size), film.image, k
