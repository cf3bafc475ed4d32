"""Where the time of a frame and of a training step goes, on the device at hand.

    python -m dubbing.lab.benchmark MANIFEST IDENTITY OUT.json

IDENTITY is a person of the manifest who was fine-tuned before. The published model (`paper` preset,
random weights, its own samples) renders a few rays of the same head, with the same references; its
frame is that time for all rays of the picture.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from dfrf.fast.model import FastModel
from dfrf.field.reference_maps import ReferenceMaps
from dubbing import jobs
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json
from dubbing.lab.timing import Row, Scene, frame_rows, matrix_rate, paper_row, training_row
from dubbing.manifest.manifest import load
from dubbing.preparation.prepared import PreparedClip
from dubbing.report.peak_memory import peak_memory
from dubbing.stages import render as heads
from dubbing.stages import tasks
from dubbing.stages.finetune import MODEL_FILE, clip_speech

FRAMES = 3


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
        manifest = load(asked.manifest)
        people = manifest.identities
        if asked.identity not in people:
            parser.error(f"no identity {asked.identity!r}; there is {', '.join(people)}")
        person = people[asked.identity]
        made = jobs.build(manifest).identities[asked.identity].stages
        clip = PreparedClip.load(made["prepare"].folder, person.clip)
        model, maps, _ = heads.load(made["finetune"].folder / MODEL_FILE, asked.device)
        offset = tasks.offset_of(made["check_source"].folder)
        speech = clip_speech(clip, person.speech, person.speech_weights, offset)
    except DubbingError as error:
        parser.error(str(error))
    if not (isinstance(model, FastModel) and isinstance(maps, ReferenceMaps | None)):
        parser.error(f"{asked.identity!r} is a person of preset 'paper'; choose one of 'fast'")
    usable = np.flatnonzero(clip.valid)
    frames = usable[np.linspace(0, len(usable) - 1, FRAMES + 2).round().astype(int)][1:-1]
    scene = Scene(model, maps, clip, speech, frames.tolist())
    rate = matrix_rate(scene.device)
    rows = frame_rows(scene)
    if maps is not None:
        rows.append(paper_row(scene))
    rows.append(training_row(scene))
    march_row = next(r for r in rows if r.stage == "march")
    rays = next(r for r in rows if r.stage == "project the grid").count
    peak = (peak_memory() or 0) / 2**30
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
