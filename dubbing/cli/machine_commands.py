"""Commands of a machine and its disk: `doctor`, `clean`."""

import sys
from typing import Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import ManifestPath, print_line
from dubbing.errors import CallError


def doctor(
    calibrate: Annotated[
        bool,
        typer.Option("--calibrate", help="Measure for `plan` how fast this machine is: a minute."),
    ] = False,
) -> None:
    """Check this machine: versions, devices, and the command that mends what is missing."""
    from dubbing.cli import console

    if calibrate:
        packages.require_renderer()
        from dubbing.batch.rates import rates_file
        from dubbing.cli import live
        from dubbing.workshop.bench.calibration import calibrate as work

        if (file := rates_file()) is None:
            raise CallError("this user has no home folder", remedy="set XDG_CACHE_HOME to one")
        with live.progress_bar("calibrate") as progress:
            found = work(progress)
        console.rates(found, file)
        return
    from dubbing.cli.doctor.doctor import examine

    findings = examine()
    console.doctor(findings)
    raise typer.Exit(int(any(finding.state == "lacking" for finding in findings)))


def clean(
    manifest: ManifestPath,
    takes: Annotated[
        bool, typer.Option("--takes", help="Also what was made of takes that are not chosen.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Remove it without being asked.")] = False,
) -> None:
    """List what in its output folder a manifest no longer asks for; remove it if you agree."""
    from dubbing.batch.cleaning import remove, surplus
    from dubbing.manifest.manifest import load

    production = load(manifest)
    found = surplus(production, takes=takes)
    for one in found:
        print_line(f"{one.size / 1e6:9.1f} MB  {one.path.relative_to(production.output)}")
    if not found:
        print_line("nothing to remove")
        return
    print_line(f"{sum(one.size for one in found) / 1e6:9.1f} MB  in {production.output}")
    if not yes and sys.stdin.isatty() and sys.stdout.isatty():
        yes = typer.confirm("Remove all of it?")
    if yes:
        remove(production, found)
    print_line("removed" if yes else "nothing was removed; --yes removes it")
