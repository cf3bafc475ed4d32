"""Arguments that several commands share, their checks, and printing."""

from pathlib import Path
from typing import Annotated, Any

import typer

from dubbing.errors import CallError, ExplainedError
from dubbing.printable import visible
from dubbing.stages import KINDS


def file_argument(metavar: str, text: str) -> Any:
    """An argument that names a file to read."""
    return typer.Argument(metavar=metavar, exists=True, dir_okay=False, help=text)


def file_option(name: str, text: str, metavar: str = "FILE") -> Any:
    """An option that names a file to read."""
    return typer.Option(name, metavar=metavar, exists=True, dir_okay=False, help=text)


ManifestPath = Annotated[Path, typer.Argument(metavar="MANIFEST", help="A manifest (YAML).")]
Only = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME", help="This dub or identity only, or all like 'a_*'; repeatable."),
]
Force = Annotated[
    list[str] | None,
    typer.Option(metavar="STAGE", help=f"Do again: {', '.join(KINDS)}."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Device = Annotated[str, typer.Option(help="auto, cpu or cuda.")]


def checked_device(name: str, *, here: bool = True) -> str:
    """The requested device.

    Args:
        here: whether this machine does the work.

    Raises:
        ExplainedError: there is no device of that name, or not here.
    """
    if name not in ("auto", "cpu", "cuda"):
        raise ExplainedError(f"no device {name!r}", "--device", "use auto, cpu or cuda")
    if name == "cuda" and here:
        import torch  # only to ask for a GPU: the command line is quick without it

        if not torch.cuda.is_available():
            raise ExplainedError("torch sees no GPU here", "--device cuda", "use auto or cpu")
    return name


def checked_size(size: int) -> int:
    """The requested side of the head crop, pixels.

    Raises:
        ExplainedError: a manifest does not allow it.
    """
    from dubbing.manifest.keys.values import SIZES

    if size not in SIZES:
        remedy = f"use {SIZES.start} to {SIZES[-1]} in steps of {SIZES.step}"
        raise ExplainedError(f"no head crop of {size} px", "--size", remedy)
    return size


def checked_output(file: Path, *read: Path) -> Path:
    """A file to write at the end of long work, which can be written now.

    Args:
        read: files of that work, which must stay.

    Raises:
        CallError: it is one of the files that are read.
        ExplainedError: it is a folder, or nothing may be written where it is to lie.
    """
    from dubbing.engine.disk.files import make_folder

    checked_path(file)
    if file.is_dir():
        raise ExplainedError("a folder, not a file to write", str(file), "give a file's name")
    for other in read:
        if file.resolve() == other.resolve() or (file.exists() and file.samefile(other)):
            raise CallError("it is read, so it cannot be written", str(file), "give another name")
    make_folder(file.parent)
    return file


def checked_path(path: Path) -> Path:
    """A path that records and reports can hold.

    Raises:
        CallError: its name is no UTF-8.
    """
    from dubbing.manifest.keys.values import check_path

    try:
        check_path(path.absolute())
    except ValueError as error:
        raise CallError(str(error), str(path)) from error
    return path


def checked_seconds(seconds: float | None, option: str = "--seconds") -> float | None:
    """The requested length in seconds.

    Raises:
        ExplainedError: it is not a length.
    """
    from dubbing.manifest.keys.values import LONGEST_SECONDS

    if seconds is not None and not 0 < seconds <= LONGEST_SECONDS:
        remedy = f"use a number up to {LONGEST_SECONDS:g}"
        raise ExplainedError(f"{seconds:g} s is no length", option, remedy)
    return seconds


def checked_stages(names: list[str] | None) -> tuple[str, ...]:
    """The stages that ``--force`` names.

    Raises:
        ExplainedError: one of them does not exist.
    """
    for name in names or ():
        if name not in KINDS:
            raise ExplainedError(f"no stage {name!r}", "--force", f"use {', '.join(KINDS)}")
    return tuple(names or ())


def print_line(text: str, *, err: bool = False) -> None:
    """Print a line; control characters are written out."""
    typer.echo(visible(text), err=err)
