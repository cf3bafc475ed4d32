"""Where the time of a frame and of a training step goes, on the device at hand.

    python -m dubbing.benchmark MANIFEST IDENTITY OUT.json

IDENTITY is a person of the manifest who was fine-tuned before. The published model (`paper` preset,
random weights, its own samples) renders a few rays of the same head, with the same references; its
frame is that time for all rays of the picture. FLOP are of matrix products and convolutions.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
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
from dfrf.marching import march
from dfrf.model import REACH, Model
from dfrf.paper import PaperModel, References
from dfrf.rendering import evaluate, head_tiles, render_rays, tile_side
from dfrf.training import fit
from dfrf.views import ReferenceMaps
from dubbing import heads, jobs
from dubbing.compositing import composite
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json
from dubbing.finetuning import MODEL_FILE, clip_windows, reference_frames
from dubbing.identity import load_identity, upper_measures
from dubbing.manifest import load
from dubbing.preparation.prepared import PreparedClip

FRAMES = 3
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
    model, device, size = scene.model, scene.device, scene.clip.size
    spent: dict[str, list[Row]] = {}

    def note(stage: str, work: Callable[[], object], count: int = 0, unit: str = "") -> None:
        row = Row(stage, timed(work, device), count, unit, flop_of(work))
        spent.setdefault(stage, []).append(row)

    focal, settings = float(scene.clip.focal), model.config.march
    for frame in scene.frames:
        camera, heard = scene.camera(frame), scene.heard(frame)
        codes = model.field.told(heard, scene.upper(frame))
        side = tile_side(model, camera[0], focal, size)
        pixels = head_tiles(model, camera[0], focal, camera[1], size, side).view(-1)
        rays, owner = scene.rays(frame, pixels), torch.zeros_like(pixels)
        step_through = partial(march, *rays, model.grid, settings, group=side * side)
        samples = step_through()
        found = samples.points.shape[0]
        note("speech code", partial(model.field.speech_codes, heard))
        project = partial(head_tiles, model, camera[0], focal, camera[1], size, side)
        note("project the grid", project, pixels.numel(), "rays")
        note("march", step_through, found, "samples")
        field = partial(evaluate, model, samples, rays[1], owner, codes, scene.maps, True)
        note("field, every sample", field, found, "samples")
        note(
            "head, until opaque",
            partial(render_rays, model, *rays, owner, codes, scene.maps, group=side * side),
            pixels.numel(),
            "rays",
        )
        (whole,) = heads.frames(*scene_arguments(scene, frame))
        ((image, matte, background),) = scene.clip.frames(frame, 1)
        note("composite", partial(composite, image, background, matte > 5, heads.to_rgba(*whole)))
    return [mean_row(rows) for rows in spent.values()]


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
    views, device, size = scene.maps.views, scene.device, scene.clip.size
    model = PaperModel().to(device).eval().requires_grad_(False)
    references = References(views.images.float() / 255, views.c2w, views.focal, views.centres)
    maps = model.encode(references)
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


def training_row(scene: Scene, prepared: Path) -> Row:
    """Steps of fine-tuning with the default settings."""
    person = load_identity("timed", prepared, scene.windows, 0, TRAINING_FRAMES)
    model = presets.adapt(scene.model, scene.model.config)
    config = replace(presets.FINETUNE, iterations=TRAINING_STEPS)
    references = reference_frames(person, scene.clip, 0, model.config.field.references)
    chosen = None if references is None else {person.name: references}
    curve = fit(model, [person], config, references=chosen, device=scene.device.type)
    first, last = curve.rows[1][3], curve.rows[-1][3]
    return Row("training step", (last - first) / (TRAINING_STEPS - 2), config.rays, "rays")


def table(rows: list[Row], rate: float) -> str:
    """The rows as text."""
    lines = [f"{'stage':26} {'seconds':>9} {'count':>16} {'a second':>10} {'MFLOP each':>10} share"]
    for row in rows:
        each = f"{row.flop / row.count / 1e6:.3f}" if row.count and row.flop else ""
        pace = f"{row.count / row.seconds:,.0f}" if row.count else ""
        share = f"{row.flop / row.seconds / rate:.0%}" if row.flop else ""
        counted = f"{row.count:,} {row.unit}" if row.count else ""
        lines.append(
            f"{row.stage:26} {row.seconds:9.4f} {counted:>16} {pace:>10} {each:>10} {share:>5}"
        )
    return "\n".join(lines)


def main() -> None:
    """Prints the table and writes it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("manifest", type=Path)
    parser.add_argument("identity")
    parser.add_argument("out", type=Path)
    parser.add_argument("--device", default="auto")
    asked = parser.parse_args()
    try:
        people = jobs.build(load(asked.manifest)).identities
        if asked.identity not in people:
            parser.error(f"no identity {asked.identity!r}; there is {', '.join(people)}")
        person = people[asked.identity].stages
        prepared = person["prepare"].folder
        clip = PreparedClip.load(prepared)
        model, maps, header = heads.load(person["finetune"].folder / MODEL_FILE, asked.device)
    except DubbingError as error:
        parser.error(str(error))
    if not (isinstance(model, Model) and isinstance(maps, ReferenceMaps | None)):
        parser.error(f"{asked.identity!r} is a person of preset 'paper'; choose one of 'fast'")
    windows = clip_windows(clip, str(header["speech"]))
    usable = np.flatnonzero(clip.valid)
    frames = usable[np.linspace(0, len(usable) - 1, FRAMES + 2).round().astype(int)][1:-1]
    scene = Scene(model, maps, clip, windows, frames.tolist())
    rate = matrix_rate(scene.device)
    rows = frame_rows(scene)
    if maps is not None:
        rows.append(paper_row(scene))
    rows.append(training_row(scene, prepared))
    march_row = next(r for r in rows if r.stage == "march")
    rays = next(r for r in rows if r.stage == "project the grid").count
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(table(rows, rate))
    print(
        f"\n{scene.device}, {torch.get_num_threads()} threads; "
        f"matrix rate {rate / 1e9:.0f} GFLOP/s; "
        f"{march_row.count / rays:.1f} samples a ray; peak memory {peak:.2f} GiB"
    )
    atomic_write_json(
        asked.out,
        {
            "device": str(scene.device),
            "threads": torch.get_num_threads(),
            "size": clip.size,
            "matrix_rate": rate,
            "samples_a_ray": march_row.count / rays,
            "peak_gib": peak,
            "rows": [asdict(row) for row in rows],
        },
    )


if __name__ == "__main__":
    main()
