"""Commands that look at one clip: `prepare`, `sync`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import (
    AsJson,
    checked_path,
    checked_size,
    file_argument,
    file_option,
    print_line,
)
from dubbing.errors import CallError, ExplainedError


def prepare(
    clip: Annotated[Path, file_argument("CLIP", "A video of one person.")],
    out: Annotated[
        str | None,
        typer.Option(metavar="PATH", help="Folder; CLIP.prepared if not given."),
    ] = None,
    size: Annotated[int, typer.Option(help="Most pixels of the head crop's side.")] = 1024,
) -> None:
    """Track, matte and restore the background of one clip; see contact_sheet.png."""
    packages.require()
    from dubbing.cli import live
    from dubbing.preparation.claim import claimed
    from dubbing.preparation.prepare import prepare as work
    from dubbing.video.own_pixels import reach

    size, clip = checked_size(size), checked_path(clip.resolve())
    if out is not None and not out.strip():
        raise ExplainedError("names no folder", "--out", "name one, or leave --out away")
    folder = checked_path(Path(out) if out else clip.with_suffix(".prepared"))
    with claimed(folder, clip), live.progress_bar(f"prepare {clip.name}") as progress:
        found = work(clip, folder, size=size, progress=progress)
    for warning in (*found.face_warnings, *found.warnings):
        print_line(f"warning: {warning}")
    print_line(f"{clip.name}: {reach(found).in_words('show the face')}")
    print_line(f"{folder / 'contact_sheet.png'}: residual shift {found.residual_shift:.3f} px")


def sync(
    video: Annotated[Path, file_argument("VIDEO", "Any video with sound.")],
    weights: Annotated[
        Path | None,
        file_option("--weights", "The published SyncNet (syncnet_v2.model), not our network."),
    ] = None,
    source: Annotated[
        Path | None,
        file_option("--source", "The clip it was dubbed from: judges it beside this one.", "CLIP"),
    ] = None,
    colour: Annotated[
        str,
        typer.Option(help="Camera log that both are in, as LogC4.", metavar="NAME"),
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Measure the lip sync of any video, and how near it is to a source. Exit code 3 on fail."""
    if source and weights:
        raise CallError(
            "judges by our network only", "--source", "leave --source or --weights away"
        )
    packages.require()
    from dubbing.cli import console, live
    from dubbing.engine.disk.numbered import with_options
    from dubbing.media.properties.film_values import space_of
    from dubbing.sync.check import check
    from dubbing.workshop.lab.syncnet.check import published_check

    shown = {"film": space_of(colour)} if colour else {}
    with live.progress_bar(f"sync {video.name}") as progress:
        if weights is None:
            own = None
            if source is not None:
                clip = with_options(source, shown)
                own = check(clip, progress=lambda share: progress("the source", share))
            found = check(
                with_options(video, shown),
                source=own,
                progress=lambda share: progress("listening and looking", share),
            )
        else:
            found = published_check(with_options(video, shown), weights)
    if as_json:
        typer.echo(json.dumps(found.to_json(), indent=2))
    else:
        console.sync(found.to_json())
    if found.verdict == "fail":
        raise typer.Exit(3)
