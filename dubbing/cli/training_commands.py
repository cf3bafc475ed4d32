"""Commands that train what comes with the tool anew."""

from pathlib import Path
from typing import Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import (
    Device,
    ManifestPath,
    checked_device,
    checked_output,
    file_argument,
    file_option,
)


def train_sync(
    clips: Annotated[list[Path], file_argument("CLIP...", "Videos of one person each.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The weights to write.")],
) -> None:
    """Train the network of the sync check on clips of people who talk."""
    packages.require()
    from dubbing.workshop.training.sync.training import train_sync as work

    about = work(clips, checked_output(out, *clips), log=typer.echo)
    typer.echo(f"wrote {out}, from {len(about['clips'])} clips")


def train_speech(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The weights to write.")],
    recordings: Annotated[
        list[Path] | None, file_option("--recording", "Speech of a person; repeatable.")
    ] = None,
    corpus: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of what is taught; OUT.corpus by default."),
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Training steps.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed.")] = 0,
) -> None:
    """Train the network of the speech features from nothing; resumes by itself."""
    packages.require("train")
    from dubbing.cli import live
    from dubbing.workshop.training.speech.training import SpeechTraining
    from dubbing.workshop.training.speech.training import train_speech as work

    settings = SpeechTraining(seed=seed, steps=steps or SpeechTraining.steps)
    out = checked_output(out, *(recordings or ()))
    folder = corpus or out.with_name(out.name + ".corpus")
    with live.progress_bar("train-speech") as progress:
        about = work(recordings or [], out, corpus=folder, settings=settings, progress=progress)
    typer.echo(f"wrote {out}, from {about['seconds'] / 60:.0f} minutes of speech")


def train_base(
    manifest: ManifestPath,
    out: Annotated[Path, typer.Option(metavar="FILE", help="The checkpoint to write.")],
    iterations: Annotated[
        int | None, typer.Option(min=1, max=10**9, help="Training steps in all.")
    ] = None,
    init: Annotated[Path | None, file_option("--init", "A checkpoint to start from.")] = None,
    method: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Of the base, as of dfrf evaluate, in place of the manifest's preset: dfrf-paper.",
        ),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Measured on instead of learned from; repeatable."),
    ] = None,
    device: Device = "auto",
) -> None:
    """Train the shared base checkpoint across the identities of a manifest; resumes by itself."""
    packages.require()
    from dubbing.cli import live
    from dubbing.manifest.manifest import load
    from dubbing.workshop.lab.variants import preset_of
    from dubbing.workshop.training.base import train_base as work

    preset = None if method is None else preset_of(method)
    loaded, chosen = load(manifest), checked_device(device)
    clips = (person.clip.path for person in loaded.people.values())
    out = checked_output(out, manifest, *clips, *([init] if init else []))
    with live.progress_bar("train-base") as progress:
        work(
            loaded,
            out,
            device=chosen,
            iterations=iterations,
            init=init,
            hold_out=tuple(hold_out or ()),
            preset=preset,
            progress=progress,
        )
    typer.echo(f"wrote {out}")
