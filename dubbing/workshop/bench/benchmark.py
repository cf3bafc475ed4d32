"""Where the time of a frame and of a training step goes, on the device at hand.

    python -m dubbing.workshop.bench.benchmark MANIFEST IDENTITY OUT.json

IDENTITY is a person of the manifest who was fine-tuned before. The published model (`paper` preset,
random weights, its own samples) renders a few rays of the same head, with the same references; its
frame is that time for all rays of the image. The networks of other tools stand beside them, see
`dubbing.workshop.bench.other_networks`: without what these tools do before and after.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
import typer
from torch import nn

from dfrf import device as devices
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.memory import peak_memory
from dubbing.errors import ExplainedError
from dubbing.heads import rendering as heads
from dubbing.workshop.bench import other_networks as others
from dubbing.workshop.bench.learned_person import LearnedPerson
from dubbing.workshop.bench.timing import (
    Row,
    Scene,
    dub_row,
    frame_rows,
    matrix_rate,
    paper_row,
    timed,
    training_row,
)

FRAMES = 3
WAV2LIP_BATCH, HEARD = 16, 50  # frames at once; speech vectors that a U-Net looks at
DDIM_STEPS, GUIDED = 20, 2  # of LatentSync, and how often it asks in each: with and without speech


@dataclass(frozen=True)
class Tool:
    """Networks of another tool: side of the crop in px, seconds a frame, parameters."""

    name: str
    crop: int
    seconds: float
    parameters: int


@torch.no_grad()
def other_tools(device: torch.device) -> list[Tool]:
    """Seconds a frame of the networks of other tools, in bfloat16 where that is native."""
    kind = devices.table_type(device)

    def take(build: Callable[[], nn.Module], *shapes: tuple[int, ...]) -> tuple[float, int]:
        with torch.device("meta"):
            network = build().to(kind).eval()
        network.to_empty(device=device)
        for weights in (*network.parameters(), *network.buffers()):
            weights.fill_(0.01)  # how long it takes does not depend on them
        given = [torch.randn(shape, device=device, dtype=kind) for shape in shapes]
        count = sum(p.numel() for p in network.parameters())
        return timed(lambda: network(*given), device), count

    def unet(channels: int, side: int, batch: int) -> tuple[float, int]:
        code, heard = (batch, others.LEVELS[0]), (batch, HEARD, others.WHISPER)
        return take(lambda: others.UNet(channels), (batch, channels, side, side), code, heard)

    decoders = {side: take(others.decoder, (1, 4, side, side)) for side in (32, 64)}
    batch = WAV2LIP_BATCH
    seconds, count = take(others.Wav2Lip, (batch, 1, 80, 16), (batch, 6, 96, 96))
    tools = [Tool("Wav2Lip", 96, seconds / batch, count)]
    seconds, count = unet(8, 32, 1)
    tools.append(Tool("MuseTalk", 256, seconds + decoders[32][0], count + decoders[32][1]))
    for side, (drawing, more) in decoders.items():
        seconds, count = unet(13, side, GUIDED)
        tools.append(Tool("LatentSync", 8 * side, DDIM_STEPS * seconds + drawing, count + more))
    return tools


def tool_table(tools: list[Tool], ours: float) -> str:
    """The other tools as text, each beside the seconds of our frame."""
    lines = [
        f"{'networks of':12} {'crop':>5} {'seconds a frame':>15} {'ours':>7} {'parameters':>14}"
    ]
    for tool in tools:
        ratio = f"x {tool.seconds / ours:.2f}"
        lines.append(
            f"{tool.name:12} {tool.crop:5} {tool.seconds:15.3f} {ratio:>7} {tool.parameters:14,}"
        )
    return "\n".join(lines)


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


def main(manifest: Path, identity: str, out: Path, device: str = "auto") -> None:
    """Measures the parts of a dub: prints the table and writes it."""
    try:
        person = LearnedPerson.of(manifest, identity)
        model, maps, _ = heads.load(person.model, device)
    except ExplainedError as error:
        raise typer.BadParameter(str(error)) from error
    if not (isinstance(model, FastModel) and isinstance(maps, ReferenceMaps | None)):
        raise typer.BadParameter(f"{identity!r} is of preset 'paper'; choose one of 'fast'")
    clip = person.clip
    usable = np.flatnonzero(clip.valid)
    frames = usable[np.linspace(0, len(usable) - 1, FRAMES + 2).round().astype(int)][1:-1]
    scene = Scene(model, maps, clip, person.speech, frames.tolist())
    rate = matrix_rate(scene.device)
    rows = [*frame_rows(scene), dub_row(scene)]
    if maps is not None:
        rows.append(paper_row(scene))
    rows.append(training_row(scene))
    tools = other_tools(scene.device)
    march_row = next(r for r in rows if r.stage == "march")
    rays = next(r for r in rows if r.stage == "project the grid").count
    ours = sum(r.seconds for r in rows if r.stage in ("baked, frames in a row", "composite"))
    peak = (peak_memory() or 0) / 2**30
    print(table(rows, rate))
    print(f"\na frame of ours: {ours:.3f} s\n{tool_table(tools, ours)}")
    print(
        f"\n{scene.device}, {torch.get_num_threads()} threads; "
        f"matrix rate {rate / 1e9:.0f} GFLOP/s; "
        f"{march_row.count / rays:.1f} samples a ray; peak memory {peak:.2f} GiB"
    )
    atomic_write_json(
        out,
        {
            "device": str(scene.device),
            "threads": torch.get_num_threads(),
            "size": clip.size,
            "matrix_rate": rate,
            "samples_a_ray": march_row.count / rays,
            "peak_gib": peak,
            "rows": [asdict(row) for row in rows],
            "other_tools": [asdict(tool) for tool in tools],
        },
    )


if __name__ == "__main__":
    typer.run(main)
