"""How alike a person's heads are on the CPU and on another device.

    python -m dubbing.workshop.bench.parity MANIFEST IDENTITY OUT.json --device cuda

IDENTITY is a person of the manifest who was fine-tuned before. Decibels of colour where the head is
opaque, baked and marched.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import typer

from dubbing.engine.disk.files import atomic_write_json
from dubbing.errors import ExplainedError
from dubbing.heads import rendering
from dubbing.workshop.bench.learned_person import LearnedPerson

FRAMES = 3
SOLID = 0.98  # opacity
WANTED = 40.0  # dB


def decibels(person: LearnedPerson, device: str) -> dict[str, list[float]]:
    """Decibels of heads on a device to those on the CPU, of some frames, by how rendered."""
    poses = np.arange(len(person.clip))
    found = {}
    for how in ("baked", "marched"):
        heads = []
        for place in ("cpu", device):
            model, maps, _ = rendering.load(person.model, place)
            of = (model, maps, person.clip, person.speech, poses, 0, FRAMES)
            rendered = rendering.frames(*of, baked=how == "baked")
            heads.append([[part.float().cpu() for part in head] for head in rendered])
        found[how] = [
            float(-10 * torch.log10((mine - theirs)[seen > SOLID].square().mean().clamp_min(1e-12)))
            for (mine, seen), (theirs, _) in zip(*heads, strict=True)
        ]
    return found


def main(manifest: Path, identity: str, out: Path, device: str = "cuda") -> None:
    """Prints the decibels and writes them; exit code 1 where they fall short."""
    try:
        found = decibels(LearnedPerson.of(manifest, identity), device)
    except ExplainedError as error:
        raise typer.BadParameter(str(error)) from error
    atomic_write_json(out, found)
    least = min(min(values) for values in found.values())
    print(f"heads on {device} beside the CPU: at least {least:.1f} dB, of {WANTED:.0f}")
    raise SystemExit(least < WANTED)


if __name__ == "__main__":
    typer.run(main)
