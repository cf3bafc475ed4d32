"""Commands for researchers: held-out figures, and checkpoints of the published code."""

from pathlib import Path
from typing import Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import (
    Device,
    ManifestPath,
    Only,
    checked_device,
    checked_output,
    checked_seconds,
    file_argument,
    file_option,
    print_line,
)
from dubbing.errors import ExplainedError


def evaluate(
    manifest: ManifestPath,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="dfrf, dfrf-alone (no base), dfrf-nocrops (no crops of mouths), dfrf-paper (nor "
            "lips: speech learned from pictures alone), paper, ad-nerf, ad-nerf-nolips (speech "
            "from pictures alone) or nerf; may be repeated.",
        ),
    ] = None,
    references: Annotated[
        int | None,
        typer.Option(min=1, max=64, help="So many in every frame, always the same."),
    ] = None,
    no_warp: Annotated[
        bool, typer.Option("--no-warp", help="Look references up where they project.")
    ] = False,
    base: Annotated[
        Path | None,
        file_option(
            "--base", "Base of the methods, in place of the manifest's or the shipped one."
        ),
    ] = None,
    only: Only = None,
    protocol: Annotated[
        str,
        typer.Option(
            help="p15 (own pictures), p15x (the speech over pictures from elsewhere, as in a dub) "
            "or both.",
        ),
    ] = "both",
    composition: Annotated[
        bool,
        typer.Option(
            "--composition",
            help="Measure, too, what the pixels of a dub are made of, and what each part of the "
            "method changes in its mouth.",
        ),
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, help="Test so many seconds of what is held out, its first."),
    ] = None,
    every: Annotated[
        int,
        typer.Option(
            min=1,
            help="P15 renders and compares one frame of so many, without figures of how the mouth "
            "moves. P15x takes all frames.",
        ),
    ] = 1,
    lpips_weights: Annotated[
        Path | None,
        file_option("--lpips-weights", "Weights of torchvision's AlexNet: measures LPIPS, too."),
    ] = None,
    device: Device = "auto",
) -> None:
    """Held-out metrics of every identity, into OUTPUT/evaluate.json."""
    packages.require()
    from dubbing.cli import console, live
    from dubbing.manifest.manifest import load
    from dubbing.workshop.lab.evaluation import evaluate as work
    from dubbing.workshop.lab.variants import variants

    chosen = variants(method or ("dfrf",), references, not no_warp, base)
    loaded = load(manifest)
    with live.progress_bar("evaluate") as progress:
        found = work(
            loaded,
            methods=chosen,
            only=tuple(only or ()),
            protocol=protocol,
            composition=composition,
            seconds=checked_seconds(seconds),
            every=every,
            lpips_weights=lpips_weights,
            device=checked_device(device),
            progress=progress,
        )
    console.metrics(found)


def import_checkpoint(
    file: Annotated[Path, file_argument("FILE", "A checkpoint of the paper's code.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The safetensors file to write.")],
) -> None:
    """Read a checkpoint of the published code into ours."""
    from dfrf.checkpoint import CheckpointError
    from dubbing.workshop.published.importing import import_checkpoint as work

    try:
        work(file, checked_output(out, file))
    except CheckpointError as error:
        raise ExplainedError(str(error)) from error
    print_line(f"wrote {out}")
