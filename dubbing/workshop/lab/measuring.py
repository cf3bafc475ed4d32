"""Held-out figures of one person's model: every metric of protocol P15, frame by frame."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, fields
from itertools import chain
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfrf.training.warp_penalty import PAPER_SIZE
from dubbing.engine.disk.files import atomic_write_text
from dubbing.engine.graph.stage import Progress
from dubbing.face.finding.landmarks import FaceMesh
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.heads import rendering as heads
from dubbing.heads.pose_refinement import refined
from dubbing.identity.dataset import mouth_boxes
from dubbing.identity.sharpness import gradient_energy
from dubbing.media import VideoWriter
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.sync.network.sync_network import load_network
from dubbing.workshop.lab import tiles
from dubbing.workshop.lab.flicker import Flicker, brow_skin
from dubbing.workshop.lab.metrics import image as metrics
from dubbing.workshop.lab.metrics.lpips import Lpips
from dubbing.workshop.lab.mouth import MouthSeries

NOT_KNOWN = float("nan")


@dataclass(frozen=True)
class FrameFigures:
    """One frame: PSNR in dB of the frame, the face and the mouth box, SSIM, HaarPSI, LPIPS, LMD of
    the outer lips where they are in the image in px at 512, and the gradient energy in the mouth
    and eye boxes as a share of the source's. What could not be measured is not a number."""

    frame: int
    psnr: float
    ssim: float
    haarpsi: float
    lpips: float
    psnr_face: float
    psnr_mouth: float
    lmd_picture: float
    sharpness_mouth: float
    sharpness_eyes: float


def extent(points: np.ndarray, size: int) -> Tensor:
    """Box round points (P, 2) in an image: left, top, right, bottom."""
    box = np.concatenate([points.min(0), points.max(0)])
    return torch.from_numpy(np.clip(box, 0, size).round())


def measure(
    model: Path,
    clip: PreparedClip,
    speech: SpeechFrames,
    first: int,
    count: int,
    out: Path,
    *,
    every: int = 1,
    lpips: Lpips | None = None,
    device: str = "auto",
    progress: Progress,
) -> dict[str, float]:
    """Renders held-out frames over their own background and compares them with the source.

    Leaves OUT/frames.csv, OUT/tiles.png (source above render), and where every frame is tested
    OUT/render_picture.mp4 and OUT/source_picture.mp4.

    Args:
        model: a person's model.
        clip: of the person; speech: the audio at its frames.
        first, count: frames to test.
        out: folder.
        every: one frame of so many is rendered and compared, its pose and speech what they are when
            all are. With more than one, how the mouth moves is not measured.
        lpips: the network, where its weights are at hand.
        device: auto, cpu or cuda.

    Returns:
        Means over the frames; the figures of `MouthSeries`; `flicker` of the render as a multiple
        of the source's, which is `source_flicker` in grey levels; and `frames`, how many were
        compared.
    """
    person, maps, _ = heads.load(model, device)
    out.mkdir(parents=True, exist_ok=True)
    figures: list[FrameFigures] = []
    rows: list[dict[str, float]] = []
    tile_rows: list[np.ndarray] = []
    flicker = Flicker(clip, brow_skin(clip))
    mouths = MouthSeries(load_network().face.numpy(), float(clip.rate))
    index = np.arange(clip.frames_count)
    tested = range(first, first + count, every)
    posed = refined(person, maps, clip, index[first : first + count], progress)
    if every == 1:
        rendered = heads.frames(person, maps, posed, speech, index, first, first + count)
    else:
        rendered = chain.from_iterable(
            heads.frames(person, maps, posed, speech, index, k, k + 1) for k in tested
        )
    with ExitStack() as open_files:
        videos = [
            open_files.enter_context(VideoWriter(path, clip.size, clip.size, clip.rate))
            for path in (out / "render_picture.mp4", out / "source_picture.mp4")
            if every == 1
        ]
        # A face is followed from frame to frame, where these are frames in a row.
        render_mesh, source_mesh = (FaceMesh(tracking=every == 1) for _ in range(2))
        for k, (image, _, background) in enumerate(clip.frames(first, count), first):
            if k not in tested:
                continue
            composed = over(*next(rendered), background)
            for video, pixels in zip(videos, (composed, image), strict=False):
                video.write(pixels)
            flicker.add(k, composed, image)
            if k in tiles.tile_frames(first, count, every):
                tile_rows.append(np.concatenate([image, composed]))
            if clip.valid[k]:
                rendered_meshes, true_meshes = render_mesh(composed), source_mesh(image)
                figures.append(
                    compare(
                        k, composed, image, clip.landmarks[k], rendered_meshes, true_meshes, lpips
                    )
                )
                mouth = mouths.add(
                    k, composed, image, first_of(rendered_meshes), first_of(true_meshes)
                )
                rows.append({**asdict(figures[-1]), **asdict(mouth)})
            progress(f"frame {k - first + 1} of {count}", (k - first + 1) / count)
    write_csv(out / "frames.csv", rows)
    tiles.write_tiles(out, tile_rows)
    return {
        **mean_figures(figures),
        **mouths.figures(in_a_row=every == 1),
        **flicker.figures(),
        "frames": len(figures),
    }


def over(colour: Tensor, opacity: Tensor, background: np.ndarray) -> np.ndarray:
    """A rendered head, premultiplied, over a background: (S, S, 3) uint8."""
    behind = torch.from_numpy(background).float() / 255
    blended = colour.cpu() + (1 - opacity.cpu()[..., None]) * behind
    return (blended.clamp(0, 1) * 255).round().to(torch.uint8).numpy()


def compare(
    frame: int,
    composed: np.ndarray,
    image: np.ndarray,
    landmarks: np.ndarray,
    rendered_meshes: list[np.ndarray],
    true_meshes: list[np.ndarray],
    lpips: Lpips | None = None,
) -> FrameFigures:
    """Figures of one frame; LMD is not known where a face is missed, LPIPS without its network."""
    size = image.shape[0]
    a, b = torch.from_numpy(composed).float() / 255, torch.from_numpy(image).float() / 255
    mouth = torch.from_numpy(mouth_boxes(landmarks[None], size)[0])
    face = extent(landmarks[list(FACE_OVAL)], size)
    eyes = extent(landmarks[[*LEFT_EYE_AND_BROW, *RIGHT_EYE_AND_BROW]], size)
    lmd = NOT_KNOWN
    if rendered_meshes and true_meshes:
        lips = list(OUTER_LIP)
        lmd = metrics.landmark_distance(
            torch.from_numpy(rendered_meshes[0][lips, :2]),
            torch.from_numpy(true_meshes[0][lips, :2]),
        )

    def sharpness(box: Tensor) -> float:
        source = gradient_energy(metrics.crop(b, box))
        return gradient_energy(metrics.crop(a, box)) / max(source, 1e-12)

    return FrameFigures(
        frame=frame,
        psnr=metrics.psnr(a, b),
        ssim=metrics.ssim(a, b),
        haarpsi=metrics.haarpsi(a, b),
        lpips=lpips(a, b) if lpips is not None else NOT_KNOWN,
        psnr_face=metrics.psnr(metrics.crop(a, face), metrics.crop(b, face)),
        psnr_mouth=metrics.psnr(metrics.crop(a, mouth), metrics.crop(b, mouth)),
        lmd_picture=lmd * PAPER_SIZE / size,
        sharpness_mouth=sharpness(mouth),
        sharpness_eyes=sharpness(eyes),
    )


def mean_figures(figures: list[FrameFigures]) -> dict[str, float]:
    """Mean of every figure over the frames that have it; `sharpness` is that of both.

    A figure that no frame has is left out.
    """
    means: dict[str, float] = {}
    for name in (f.name for f in fields(FrameFigures) if f.name != "frame"):
        known = [value for x in figures if not np.isnan(value := getattr(x, name))]
        if known:
            means[name] = float(np.mean(known))
    if figures:
        means["sharpness"] = (means["sharpness_mouth"] + means["sharpness_eyes"]) / 2
    return means


def first_of(faces: list[np.ndarray]) -> np.ndarray | None:
    """The mesh of the face that was found; None where there is none."""
    return faces[0] if faces else None


def write_csv(path: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """One row a frame; all have the same keys."""
    text = io.StringIO()
    if rows:
        table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    atomic_write_text(path, text.getvalue())
