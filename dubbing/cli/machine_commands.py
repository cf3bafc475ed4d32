"""The command of a machine: `doctor`."""

from typing import Annotated

import typer

from dubbing import packages
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
