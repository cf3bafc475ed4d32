"""The manifest: who was filmed, their new speech, and where the results go.

``load`` reports every problem at once, each with its key path and line. A clip or a sound that is
there but damaged is no mistake in the manifest: it is kept in ``Manifest.damaged`` and fails only
what needs it.
"""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from dubbing.errors import DubbingError, ManifestError, MediaError, Problem
from dubbing.files import read_bounded
from dubbing.manifest import overwriting, yaml_lines
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.findings import Scene
from dubbing.manifest.reader import Reader
from dubbing.manifest.values import check_path
from dubbing.media import MediaInfo

MOST_BYTES = 10 * 10**6


class Manifest(BaseModel):
    """A manifest without mistakes.

    Attributes:
        scenes: of each dub, except those whose files are damaged.
        media: of the readable files. damaged: the others.
        blocked: dubs that need one of these for their sound.
    """

    model_config = ConfigDict(frozen=True, arbitrary_types_allowed=True)

    path: Path
    output: Path
    identities: dict[str, Identity]
    dubs: tuple[Dub, ...]
    scenes: dict[str, Scene]
    media: dict[Path, MediaInfo]
    damaged: dict[Path, MediaError]
    blocked: dict[str, MediaError]
    warnings: tuple[str, ...] = ()

    @property
    def work(self) -> Path:
        """Where the stages keep what they make."""
        return self.output / overwriting.WORK


def load(path: Path | str, only: tuple[str, ...] = (), *, from_base: bool = False) -> Manifest:
    """Read and check a manifest and every file it names.

    Args:
        only: look into the files of these identities and dubs alone, and of what they need.
        from_base: whether people will be learned from their bases.

    Raises:
        ManifestError: with all problems found.
    """
    path = Path(path)
    try:
        path = path.resolve()
        check_path(path)
        text = read_bounded(path, MOST_BYTES).decode()
    except FileNotFoundError:
        raise ManifestError(str(path), [Problem(0, "", "no such file")]) from None
    except (OSError, RuntimeError, ValueError) as error:
        raise ManifestError(str(path), [Problem(0, "", f"cannot be read: {error}")]) from error
    except DubbingError as error:
        raise ManifestError(str(path), [Problem(0, "", error.what)]) from error
    reader = Reader(path, yaml_lines.read(text), only)
    output, dubs, findings = reader.read()
    reader.found += findings.baseless if from_base else []
    if (problems := reader.problems()) or output is None:
        raise ManifestError(str(path), problems)
    return Manifest(
        path=path,
        output=output,
        identities=findings.identities,
        dubs=tuple(dubs.values()),
        scenes={dubs[place].name: scene for place, scene in findings.scenes.items()},
        media=findings.media,
        damaged=findings.damaged,
        blocked={dubs[place].name: error for place, error in findings.blocked.items()},
        warnings=tuple(findings.warnings),
    )
