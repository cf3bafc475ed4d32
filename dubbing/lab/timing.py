"""How long the parts of a frame and of a training step take a person's model, and their FLOP.

FLOP are of matrix products and convolutions.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from dfrf import device as devices
from dfrf import presets
from dfrf.cameras import pixel_rays
from dfrf.data import neighbour_windows
from dfrf.field.model import REACH, Model
from dfrf.field.reference_maps import ReferenceMaps, ReferenceViews
from dfrf.published.model import PaperModel, References
from dfrf.registry import method_of
from dfrf.rendering.frame_renderer import head_tiles, render_frame, tile_side
from dfrf.rendering.pose_refinement import normal_equations
from dfrf.rendering.ray_marching import march
from dfrf.rendering.volume_rendering import evaluate
from dfrf.training.fit import fit
from dubbing.compositing.composite import replacement
from dubbing.compositing.face_mask import rendered_region
from dubbing.identity.dataset import load_identity, upper_measures
from dubbing.preparation.prepared import PreparedClip
from dubbing.stages import render as heads
from dubbing.stages.finetune import reference_frames
from dubbing.stages.refine_poses import sights_of

PAPER_RAYS = 96
TRAINING_FRAMES, TRAINING_STEPS = 50, 10
MATRIX = 256  # side of the weights whose product gives the matrix rate


@dataclass(frozen=True)
class Row:
    """One stage: seconds a frame (or step), what was counted, and FLOP of the whole stage."""

    stage: str
    seconds: float
    count: int = 0
    unit: str = ""
    flop: float = 0.0


def timed(work: Callable[[], object], device: torch.device) -> float:
    """Seconds of the second of two calls."""
    work()
    devices.finish(device)
    began = time.perf_counter()
    work()
    devices.finish(device)
    return time.perf_counter() - began


def flop_of(work: Callable[[], object]) -> float:
    """FLOP of matrix products and convolutions in a call."""
    counter = FlopCounterMode(display=False)
    with counter:
        work()
    return float(counter.get_total_flops())


def matrix_rate(device: torch.device) -> float:
    """FLOP a second of a linear layer over a chunk of points."""
    points = torch.randn(devices.chunk_size(device), MATRIX, device=device)
    weight = torch.randn(MATRIX, MATRIX, device=device)

    def work() -> None:
        with devices.arithmetic(device):
            h = points
            for _ in range(8):
                h = F.linear(h, weight)

    return 8 * 2 * points.shape[0] * MATRIX**2 / timed(work, device)


@dataclass(frozen=True)
class Scene:
    """A person's model, its clip, and the frames that are timed."""

    model: Model
    maps: ReferenceMaps | None
    clip: PreparedClip
    windows: np.ndarray
    frames: list[int]

    @property
    def device(self) -> torch.device:
        return self.model.grid.low.device

    def camera(self, frame: int) -> tuple[Tensor, Tensor]:
        """c2w (3, 4) and principal point (2,)."""
        c2w = torch.from_numpy(self.clip.c2w()[frame]).float().to(self.device)
        return c2w, torch.from_numpy(self.clip.centre[frame]).float().to(self.device)

    def rays(self, frame: int, pixels: Tensor) -> tuple[Tensor, Tensor]:
        """Origins and unit directions (P, 3) through row-major pixels (P,)."""
        c2w, centre = self.camera(frame)
        size, count = self.clip.size, pixels.numel()
        position = torch.stack([pixels % size, pixels // size], -1).float()
        origins, directions = pixel_rays(
            c2w.expand(count, 3, 4), float(self.clip.focal), centre.expand(count, 2), position
        )
        return origins, F.normalize(directions, dim=-1)

    def heard(self, frame: int) -> Tensor:
        """Speech windows (2 REACH + 1, 8, 16, D) of a frame, those beside it, and neighbours."""
        windows = torch.from_numpy(self.windows).float()
        number = torch.arange(frame - REACH, frame + REACH + 1).clamp(0, len(windows) - 1)
        near = neighbour_windows(windows, torch.zeros(len(windows)), number)
        return near.to(self.device)

    def upper(self, frame: int) -> Tensor:
        """Measures of the upper face (1, U)."""
        return torch.from_numpy(upper_measures(self.clip)[[frame]]).float().to(self.device)


@torch.no_grad()
def frame_rows(scene: Scene) -> list[Row]:
    """What a frame of `fast` is made of, means over the frames."""
    frames = [parts_of(scene, frame) for frame in scene.frames]
    return [mean_row(list(rows)) for rows in zip(*frames, strict=True)]


def parts_of(scene: Scene, frame: int) -> list[Row]:
    """The stages of one frame.

    Each is a lambda, whose call the type checker looks at; `partial` would hide it.
    """
    model, maps, device, size = scene.model, scene.maps, scene.device, scene.clip.size
    rows: list[Row] = []

    def note(stage: str, work: Callable[[], object], count: int = 0, unit: str = "") -> None:
        rows.append(Row(stage, timed(work, device), count, unit, flop_of(work)))

    focal, settings = float(scene.clip.focal), model.config.march
    (c2w, centre), heard = scene.camera(frame), scene.heard(frame)
    codes = model.field.told(heard, scene.upper(frame))
    side = tile_side(model, c2w, focal, size)
    pixels = head_tiles(model, c2w, focal, centre, size, side).view(-1)
    (origins, directions), owner = scene.rays(frame, pixels), torch.zeros_like(pixels)
    samples = march(origins, directions, model.grid, settings, group=side * side)
    found, rays = samples.points.shape[0], pixels.numel()
    note("speech code", lambda: model.field.speech_codes(heard))
    note(
        "project the grid",
        lambda: head_tiles(model, c2w, focal, centre, size, side),
        rays,
        "rays",
    )
    note(
        "march",
        lambda: march(origins, directions, model.grid, settings, group=side * side),
        found,
        "samples",
    )
    near = None if maps is None else maps.near(c2w[:, 3], model.config.field.references)
    note(
        "field, every sample",
        lambda: evaluate(model, samples, directions, owner, codes, near, True),
        found,
        "samples",
    )
    note(
        "head, what is seen",
        lambda: render_frame(model, c2w, focal, centre, codes[0], maps, size),
        rays,
        "rays",
    )
    landmarks = scene.clip.landmarks[frame]
    region = torch.from_numpy(rendered_region(landmarks, size)).to(device)
    note(
        "head, what a dub shows",
        lambda: render_frame(model, c2w, focal, centre, codes[0], maps, size, region),
        int(region.sum()),
        "px",
    )
    sight = sights_of(scene.clip, np.array([frame]))[frame].to(device)
    note(
        "a step of a pose",
        lambda: normal_equations(model, sight, c2w, codes[0], maps),
        7 * len(sight.pixels),
        "rays",
    )
    (whole,) = heads.frames(*scene_arguments(scene, frame))
    ((image, matte, background),) = scene.clip.frames(frame, 1)
    head = heads.to_rgba(*whole)
    note("composite", lambda: replacement(image, matte, background, head, landmarks))
    return rows


def scene_arguments(
    scene: Scene, frame: int
) -> tuple[Model, ReferenceMaps | None, PreparedClip, np.ndarray, np.ndarray, int, int]:
    """Arguments of `heads.frames` for one frame."""
    index = np.arange(scene.clip.frames_count)
    return scene.model, scene.maps, scene.clip, scene.windows, index, frame, frame + 1


def mean_row(rows: list[Row]) -> Row:
    """Mean of the same stage over frames."""
    count = len(rows)
    return Row(
        rows[0].stage,
        sum(r.seconds for r in rows) / count,
        round(sum(r.count for r in rows) / count),
        rows[0].unit,
        sum(r.flop for r in rows) / count,
    )


@torch.no_grad()
def paper_row(scene: Scene) -> Row:
    """A frame of the published model, from some of its rays through the same head."""
    assert scene.maps is not None
    device, size = scene.device, scene.clip.size
    model = PaperModel().to(device).eval().requires_grad_(False)
    maps = model.encode(whole_faces(scene.maps.views, scene.model.config.field.references))
    frame = scene.frames[0]
    camera = scene.camera(frame)
    head = head_tiles(scene.model, camera[0], float(scene.clip.focal), camera[1], size, 1).view(-1)
    pixels = head[torch.linspace(0, head.numel() - 1, PAPER_RAYS, device=device).long()]
    origins, directions = scene.rays(frame, pixels)
    near, far = float(scene.clip.near), float(scene.clip.far)
    windows = torch.zeros(8, 16, model.config.speech_dim, device=device)
    behind = torch.zeros(PAPER_RAYS, 3, device=device)

    def work() -> object:
        return model(origins, directions, near, far, windows, maps, behind)

    factor = size * size / PAPER_RAYS
    return Row(
        "paper: a frame, all rays",
        timed(work, device) * factor,
        size * size,
        "rays",
        flop_of(work) * factor,
    )


def whole_faces(views: ReferenceViews, count: int) -> References:
    """Some of the references as the published model takes them: none of shut eyes."""
    faces = slice(0, min(count, views.faces.stop))
    images = views.images[faces].float() / 255
    return References(images, views.c2w[faces], views.focal, views.centres[faces])


def training_row(scene: Scene, prepared: Path) -> Row:
    """Steps of fine-tuning with the default settings."""
    person = load_identity("timed", prepared, scene.windows, 0, TRAINING_FRAMES)
    model = presets.adapt(scene.model, scene.model.config)
    config = replace(presets.FINETUNE, iterations=TRAINING_STEPS)
    references = reference_frames(person, scene.clip, 0, method_of(model))
    chosen = None if references is None else {person.name: references}
    curve = fit(model, [person], config, references=chosen, device=scene.device.type)
    first, last = curve.rows[1][3], curve.rows[-1][3]
    return Row("training step", (last - first) / (TRAINING_STEPS - 2), config.rays, "rays")
