"""How long the parts of a frame and of a training step take a person's model, and their FLOP.

FLOP are of matrix products and convolutions.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from dfrf import device as devices
from dfrf import presets
from dfrf.cameras import Camera
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.reference_views import ReferenceViews
from dfrf.method_interface import FrameInputs
from dfrf.presets import method_of
from dfrf.published.conditioned_field import References
from dfrf.published.paper_model import PaperModel
from dfrf.rendering.frame_renderer import BLOCK, head_blocks, render_frame
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.pose_refinement import normal_equations
from dfrf.rendering.ray_marching import march
from dfrf.rendering.volume_rendering import evaluate
from dfrf.training.fit import FitOptions, fit
from dubbing.compositing.composite import replacement
from dubbing.compositing.face_mask import rendered_region
from dubbing.heads import rendering as heads
from dubbing.heads.fine_tuning import reference_frames
from dubbing.heads.frame_inputs import inputs_of
from dubbing.heads.pose_refinement import observations_of
from dubbing.identity.clip_frames import ClipFrames
from dubbing.identity.dataset import load_identity
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames

PAPER_RAYS = 96
IN_A_ROW = 8  # frames
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
    devices.synchronize(device)
    began = time.perf_counter()
    work()
    devices.synchronize(device)
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

    model: FastModel
    maps: ReferenceMaps | None
    clip: PreparedClip
    speech: SpeechFrames
    frames: list[int]

    @property
    def device(self) -> torch.device:
        return self.model.grid.low.device

    def inputs(self, frame: int) -> FrameInputs:
        """Inputs of the head in a frame."""
        index = np.arange(len(self.clip))
        return inputs_of(self.model, self.clip, self.speech, index, frame, frame + 1)

    def camera(self, frame: int) -> Camera:
        """The camera of a frame."""
        inputs = self.inputs(frame)
        return Camera(inputs.c2w[0], inputs.focal, inputs.centres[0], inputs.size)


@torch.no_grad()
def frame_rows(scene: Scene) -> list[Row]:
    """Times of the stages of a frame of `fast`, means over the frames."""
    frames = [parts_of(scene, frame) for frame in scene.frames]
    return [mean_row(list(rows)) for rows in zip(*frames, strict=True)]


def parts_of(scene: Scene, frame: int) -> list[Row]:
    """The stages of one frame.

    Each is a lambda, whose call the type checker looks at; `partial` would hide it.
    """
    model, device = scene.model, scene.device
    settings, grid = model.config.march, model.grid
    rows: list[Row] = []

    def note(stage: str, work: Callable[[], object], count: int = 0, unit: str = "") -> None:
        rows.append(Row(stage, timed(work, device), count, unit, flop_of(work)))

    camera, inputs = scene.camera(frame), scene.inputs(frame)
    windows = inputs.windows
    conditioning = model.field.conditioning(windows, inputs.predicted_lips, inputs.expression)
    volume = model.volume(conditioning, scene.maps)
    pixels = head_pixels(grid, camera)
    rays = camera.rays(pixels)
    samples = march(rays, grid, settings)
    count_samples = samples.points.shape[0]
    field = volume.field.seen_from(camera.c2w[:, 3])
    note("speech code", lambda: model.field.conditioning.speech_codes(windows))
    note("project the grid", lambda: head_blocks(grid, camera), pixels.numel(), "rays")
    note("march", lambda: march(rays, grid, settings), count_samples, "samples")
    note("field, every sample", lambda: evaluate(field, samples, rays), count_samples, "samples")
    note("head, what is seen", lambda: render_frame(volume, camera), pixels.numel(), "rays")
    landmarks = scene.clip.landmarks[frame]
    region = torch.from_numpy(rendered_region(landmarks, scene.clip.size)).to(device)
    replaced = int(region.sum())
    note("head, what a dub shows", lambda: render_frame(volume, camera, region), replaced, "px")
    baked = FastMethod(model).speaking_heads(replace(inputs, baked=True), scene.maps)(0)
    note("baked head, what a dub shows", lambda: baked.render(camera, region), replaced, "px")
    observations = observations_of(scene.clip, np.array([frame]))[frame].to(device)
    count = 3 * len(observations.pixels)
    note(
        "a step of a pose", lambda: normal_equations(baked, observations, camera.c2w), count, "rays"
    )
    (whole,) = heads.frames(*scene_arguments(scene, frame))
    (film,) = scene.clip.film_frames(frame, 1)
    head = heads.to_rgba(*whole)
    note("composite", lambda: replacement(film, head))
    return rows


@torch.no_grad()
def dub_row(scene: Scene) -> Row:
    """A frame of a dub: what it shows of the head, frames in a row, on as many cores as there are.

    Off the baked density, where the person has one.
    """
    first = min(scene.frames[0], scene.clip.frames_count - IN_A_ROW)
    regions = heads.regions_of(scene.clip, np.arange(first, first + IN_A_ROW))
    arguments = scene_arguments(scene, first, IN_A_ROW)
    seconds = timed(lambda: list(heads.frames(*arguments, regions, baked=True)), scene.device)
    return Row("baked, frames in a row", seconds / IN_A_ROW)


def head_pixels(grid: OccupancyGrid, camera: Camera) -> Tensor:
    """Row-major pixels (P,) that open cells can cover."""
    blocks = head_blocks(grid, camera).repeat_interleave(BLOCK, 0).repeat_interleave(BLOCK, 1)
    return blocks[: camera.size, : camera.size].flatten().nonzero()[:, 0]


def scene_arguments(
    scene: Scene, first: int, count: int = 1
) -> tuple[FastModel, ReferenceMaps | None, PreparedClip, SpeechFrames, np.ndarray, int, int]:
    """Arguments of `heads.frames` for some frames in a row."""
    index = np.arange(scene.clip.frames_count)
    return scene.model, scene.maps, scene.clip, scene.speech, index, first, first + count


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
    camera = scene.camera(scene.frames[0])
    head = head_pixels(scene.model.grid, camera)
    pixels = head[torch.linspace(0, head.numel() - 1, PAPER_RAYS, device=device).long()]
    rays = camera.rays(pixels)
    near, far = float(scene.clip.near), float(scene.clip.far)
    windows = torch.zeros(8, 16, model.config.speech_dim, device=device)
    behind = torch.zeros(PAPER_RAYS, 3, device=device)

    def work() -> object:
        return model(rays.origins, rays.directions, near, far, windows, maps, behind)

    factor = size * size / PAPER_RAYS
    return Row(
        "paper: a frame, all rays",
        timed(work, device) * factor,
        size * size,
        "rays",
        flop_of(work) * factor,
    )


def whole_faces(views: ReferenceViews, count: int) -> References:
    """Some of the references as the published model takes them."""
    images = views.images[:count].float() / 255
    return References(images, views.c2w[:count], views.focal, views.centres[:count])


def training_row(scene: Scene) -> Row:
    """Steps of fine-tuning with the default settings."""
    frames = np.flatnonzero(scene.clip.valid)[:TRAINING_FRAMES]
    person = load_identity("timed", [ClipFrames(scene.clip, scene.speech, frames)])
    model = presets.adapt(scene.model, scene.model.config)
    config = replace(presets.FINETUNE, iterations=TRAINING_STEPS)
    references = reference_frames(person, scene.clip.landmarks[frames], method_of(model))
    chosen = None if references is None else {person.name: references}
    curve = fit(method_of(model), [person], config, chosen, FitOptions(device=scene.device.type))
    first, last = curve.rows[1][3], curve.rows[-1][3]
    return Row("training step", (last - first) / (TRAINING_STEPS - 2), config.rays, "rays")
