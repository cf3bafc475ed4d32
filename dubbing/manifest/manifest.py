"""Loading a manifest: who was filmed, their new speech, and where the results go.

``load`` reports every problem at once, each with its key path and line. A clip or a sound that is
there but damaged is no mistake in the manifest: it blocks only the people and dubs that need it.
"""

from dataclasses import replace
from pathlib import Path

from dubbing.engine.disk.files import read_text
from dubbing.errors import ExplainedError, ManifestError, Problem
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.keys.values import check_path
from dubbing.manifest.reader import Reader
from dubbing.manifest.resolving import resolved
from dubbing.production.production import Production

MOST_BYTES = 10 * 10**6
NO_MANIFEST = "a manifest is a YAML file, as `dfrf init` writes it"


def load(path: Path | str, only: tuple[str, ...] = (), *, from_base: bool = False) -> Production:
    """Read and check a manifest and every file it names.

    Args:
        only: look into the files of these identities and dubs alone, and of those that they need.
        from_base: whether people will be learned from their bases.

    Raises:
        ManifestError: with all problems found.
    """
    path = Path(path)
    try:
        path = path.resolve()
        check_path(path)
        text = read_text(path, MOST_BYTES)
    except FileNotFoundError:
        raise ManifestError(str(path), [Problem(0, "", "no such file")]) from None
    except (OSError, RuntimeError, ValueError) as error:
        raise ManifestError(str(path), [Problem(0, "", f"cannot be read: {error}")]) from error
    except ExplainedError as error:
        raise ManifestError(
            str(path), [Problem(0, "", f"{error.what}: {error.remedy}; {NO_MANIFEST}")]
        ) from error
    reader = Reader(path, yaml_lines.read(text), only)
    output, dubs, findings = reader.read()
    reader.found += findings.baseless if from_base else []
    if (problems := reader.problems()) or output is None:
        raise ManifestError(str(path), problems)
    return replace(resolved(path, output, dubs, findings), timeline=reader.timeline)
