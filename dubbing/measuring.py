"""Held-out figures of one person's model: every metric of protocol P15, frame by frame."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass, fields
from fractions import Fraction
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfrf import metrics
from dubbing import heads
from dubbing.files import atomic_write_text
from dubbing.identity import OUTER_LIPS, mouth_boxes
from dubbing.media import VideoWriter
from dubbing.preparation.landmarks import FaceMesh
from dubbing.preparation.mesh_points import FACE_OVAL, LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW
from dubbing.preparation.prepared import PreparedClip

LONG_CLIP = 30.0  # seconds; a longer clip is tested on more of it
PAPER_SIZE = 512


@dataclass(frozen=True)
class FrameFigures:
    """One frame: PSNR in dB of the frame, the face and the mouth box, SSIM, LMD in px at 512, and
    the gradient energy in the mouth and eye boxes as a share of the source's."""

    frame: int
    psnr: float
    ssim: float
    psnr_face: float
    psnr_mouth: float
    lmd: float
    sharpness_mouth: float
    sharpness_eyes: float


def held_out(clip: PreparedClip, learned_to: float) -> tuple[int, int]:
    """First frame and number of frames to test on: the last 5 s, or 10 s of a clip over 30 s.

    Frames that were learned from (up to `learned_to` seconds) are left out.
    """
    length = float(clip.frames_count / clip.rate)
    seconds = 10 if length > LONG_CLIP else 5
    first = max(clip.frames_count - round(seconds * clip.rate), round(learned_to * clip.rate))
    return first, clip.frames_count - first


def box_of(points: np.ndarray, size: int, margin: float = 0.0) -> Tensor:
    """Box round points (P, 2), grown by a share of its size: left, top, right, bottom."""
    low, high = points.min(0), points.max(0)
    grow = (high - low) * margin
    return torch.from_numpy(np.clip([*(low - grow), *(high + grow)], 0, size).round())


def measure(
    model: Path,
    prepared: Path,
    windows: np.ndarray,
    first: int,
    count: int,
    out: Path | None = None,
    device: str = "auto",
) -> list[FrameFigures]:
    """Renders held-out frames over their own background and compares them with the source.

    Args:
        model: a person's model. prepared: the clip, `windows` its speech windows (T, 16, D).
        first, count: frames to test.
        out: where to leave `frames.csv` and the rendered crop `render.mkv`; None leaves nothing.
        device: auto, cpu or cuda.
    """
    person, maps, _ = heads.load(model, device)
    clip = PreparedClip.load(prepared)
    figures: list[FrameFigures] = []
    index = np.arange(clip.frames_count)
    rendered = heads.frames(person, maps, clip, windows, index, first, first + count)
    video = None
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        video = VideoWriter(out / "render.mkv", clip.size, clip.size, clip.rate, "ffv1")
        video.__enter__()
    with FaceMesh(tracking=True) as seen_mesh, FaceMesh(tracking=True) as source_mesh:
        for k, (image, _, background), (colour, opacity) in zip(
            range(first, first + count), clip.frames(first, count), rendered, strict=True
        ):
            restored = torch.from_numpy(background).float() / 255
            picture = colour.cpu() + (1 - opacity.cpu()[..., None]) * restored
            shown = (picture.clamp(0, 1) * 255).round().to(torch.uint8)
            if video is not None:
                video.write(shown.numpy())
            if not clip.valid[k]:
                continue
            figures.append(
                compare(
                    k,
                    shown.numpy(),
                    image,
                    clip.landmarks[k],
                    seen_mesh(shown.numpy()),
                    source_mesh(image),
                )
            )
    if video is not None and out is not None:
        video.__exit__(None, None, None)
        write_csv(out / "frames.csv", figures)
    return figures


def compare(
    frame: int,
    shown: np.ndarray,
    image: np.ndarray,
    landmarks: np.ndarray,
    found: list[np.ndarray],
    truth: list[np.ndarray],
) -> FrameFigures:
    """Figures of one frame; LMD is not a number where a face is missed."""
    size = image.shape[0]
    a, b = torch.from_numpy(shown).float() / 255, torch.from_numpy(image).float() / 255
    mouth = torch.from_numpy(mouth_boxes(landmarks[None], size)[0])
    face = box_of(landmarks[list(FACE_OVAL)], size)
    eyes = box_of(landmarks[[*LEFT_EYE_AND_BROW, *RIGHT_EYE_AND_BROW]], size)
    lmd = float("nan")
    if found and truth:
        lips = list(OUTER_LIPS)
        lmd = metrics.landmark_distance(
            torch.from_numpy(found[0][lips, :2]), torch.from_numpy(truth[0][lips, :2])
        )

    def sharpness(box: Tensor) -> float:
        source = metrics.gradient_energy(metrics.crop(b, box))
        return metrics.gradient_energy(metrics.crop(a, box)) / max(source, 1e-12)

    return FrameFigures(
        frame=frame,
        psnr=metrics.psnr(a, b),
        ssim=metrics.ssim(a, b),
        psnr_face=metrics.psnr(metrics.crop(a, face), metrics.crop(b, face)),
        psnr_mouth=metrics.psnr(metrics.crop(a, mouth), metrics.crop(b, mouth)),
        lmd=lmd * PAPER_SIZE / size,
        sharpness_mouth=sharpness(mouth),
        sharpness_eyes=sharpness(eyes),
    )


def mean_figures(figures: list[FrameFigures]) -> dict[str, float]:
    """Mean of every figure over the frames, missing ones left out."""
    return {
        f.name: float(np.nanmean([getattr(x, f.name) for x in figures]))
        for f in fields(FrameFigures)
        if f.name != "frame"
    }


def write_csv(path: Path, figures: list[FrameFigures]) -> None:
    """One row a frame."""
    text = io.StringIO()
    rows = csv.DictWriter(text, [f.name for f in fields(FrameFigures)], lineterminator="\n")
    rows.writeheader()
    rows.writerows(asdict(x) for x in figures)
    atomic_write_text(path, text.getvalue())


def frame_step(rate: Fraction, per_second: float) -> int:
    """Every how many frames to test, for so many tested frames a second."""
    return max(1, round(float(rate) / per_second))
