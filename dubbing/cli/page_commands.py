"""Commands of the pages: `studio` for edits, `share` and `notes` for the report, `rate`."""

import os
import secrets
import socket
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from dubbing import packages
from dubbing.cli.arguments import (
    Device,
    ManifestPath,
    checked_device,
    checked_output,
    checked_path,
    file_argument,
    file_option,
    print_line,
)
from dubbing.errors import CallError, ExplainedError

PASSWORD = "DFRF_STUDIO_PASSWORD"
SHORTEST = 8  # characters of a password
LOCAL = "127.0.0.1"


def studio(
    manifest: ManifestPath,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any that is free.")] = 0,
    host: Annotated[
        str,
        typer.Option(help="Address to listen at; any but this machine's own needs a password."),
    ] = LOCAL,
    password_file: Annotated[
        Path | None,
        file_option("--password-file", f"File with the password; or {PASSWORD} is set."),
    ] = None,
    device: Device = "auto",
) -> None:
    """Edit the lips of dubs on a page, and see their draft at once."""
    packages.require("studio")
    import uvicorn

    from dubbing.batch.task import LOADED
    from dubbing.engine.forks import load_beforehand
    from dubbing.manifest.manifest import load
    from dubbing.studio.drafter import Drafter
    from dubbing.studio.making import Making
    from dubbing.studio.project import Project
    from dubbing.studio.server import app_of

    password = _password(password_file)
    if host not in (LOCAL, "localhost", "::1") and not password:
        remedy = f"set {PASSWORD}, or give --password-file"
        raise CallError(
            "whoever reaches that address could open the page", f"--host {host}", remedy
        )
    production = load(manifest)
    project = Project(production)
    if not project.dubs:
        what = next(iter(project.lacking.values()), "the manifest has no dubs")
        raise ExplainedError(what, str(manifest), f"run: dfrf dub {manifest}")
    for stale in project.stale():
        print_line(f"out of date, so dfrf dub will make it anew: {stale}", err=True)
    listener = listening(host, port)
    token = password or secrets.token_urlsafe(24)
    port = listener.getsockname()[1]
    load_beforehand(LOADED)
    drafter = Drafter(production.manifest, checked_device(device))
    making = Making(production.manifest, device)
    own = {"token": token, "host": host, "port": port, "password": bool(password)}
    app = app_of(project, drafter, making, **own)
    name = f"[{host}]" if ":" in host else host
    print_line(f"http://{name}:{port}/" + ("" if password else f"?token={token}"))
    print_line("Keep this open; Ctrl-C ends it. Edits are saved as they are made.")
    config = uvicorn.Config(
        app, log_level="warning", timeout_graceful_shutdown=1, proxy_headers=False
    )
    with suppress(KeyboardInterrupt):  # the way to end it
        uvicorn.Server(config).run(sockets=[listener])


def _password(file: Path | None) -> str:
    """The password that was given; '' without one."""
    given = file.read_text(encoding="utf-8").strip() if file else os.environ.get(PASSWORD, "")
    if (file or given) and len(given) < SHORTEST:
        where = str(file or PASSWORD)
        raise CallError(
            f"a password of less than {SHORTEST} characters", where, "take a longer one"
        )
    return given


def listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        what = f"cannot listen there: {error.strerror or error}"
        raise CallError(what, f"--host {host} --port {port}", "choose another") from error
    return listener


def share(
    manifest: ManifestPath,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT.zip", help="The archive to write.")
    ],
) -> None:
    """Pack the last report with its videos into one file that opens anywhere, to be mailed."""
    from dubbing.manifest.manifest import load
    from dubbing.report.share import pack

    production = load(manifest)
    output = checked_output(output, production.manifest)
    for name in pack(production, output):
        print_line(f"without a video, as it is not made: {name}", err=True)
    print_line(f"{output}: {output.stat().st_size / 1e6:.1f} MB; unpack it and open report.html")


def notes(
    file: Annotated[Path, file_argument("FILE", "Notes, as the page of the report writes them.")],
    manifest: ManifestPath,
) -> None:
    """Put notes that were made on the report into NAME.edits.yaml, beside the manifest."""
    from dubbing.manifest.edits.edits_file import edits_file
    from dubbing.manifest.edits.notes import put
    from dubbing.manifest.manifest import load

    production = load(manifest)
    for name, found in put(production, file).items():
        redo = sum(note.status == "redo" for note in found)
        where = edits_file(production.manifest, name).name
        print_line(f"{where}: {len(found)} line{'' if len(found) == 1 else 's'}, {redo} to redo")


def rate(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...",
            exists=True,
            help="Manifests of two or more versions of the same dubs; with --answers, the FOLDER.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Make rate.html there, its videos, and pairs.json, which says what was what.",
        ),
    ] = None,
    answers: Annotated[
        list[Path] | None,
        file_option("--answers", "Answers that the page saved; further files may follow."),
    ] = None,
) -> None:
    """Compare versions of dubs blindly: make a page of pairs, or say what people answered to it."""
    from dubbing.rating import pairs

    if output is not None:
        from dubbing.manifest.manifest import load

        if answers or len(paths) < 2:
            remedy = "give two or more manifests to make a page, or --answers alone"
            raise CallError("this makes no page of pairs", f"--output {output}", remedy)
        key, left_out = pairs.write([load(path) for path in paths], checked_path(output))
        for line in left_out:
            print_line(f"left out: {line}", err=True)
        print_line(
            f"{output / pairs.PAGE}: {len(key['pairs'])} pairs; keep {pairs.KEY} to yourself"
        )
        return
    if not answers or not paths[0].is_dir():
        remedy = "give manifests and --output FOLDER, or FOLDER and --answers FILE ..."
        raise CallError("nothing to make and nothing to read", str(paths[0]), remedy)
    from dubbing.rating.answers import read
    from dubbing.rating.summary import in_words

    key = pairs.read(paths[0])
    for line in in_words(read([*answers, *paths[1:]], key), key):
        print_line(line)
