"""Commands about the report: `share`, `notes`."""

from pathlib import Path
from typing import Annotated

import typer

from dubbing.cli.arguments import ManifestPath, checked_output, file_argument, print_line


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
