"""Where this user's settings and caches lie: nowhere, for a user without a home folder."""

import os
import sys
from importlib import metadata
from pathlib import Path

import typer


def settings_folder() -> Path | None:
    """Of this tool; None where the user has none, as in a container with a bare number."""
    folder = Path(typer.get_app_dir("dfrf"))
    named = os.environ.get("XDG_CONFIG_HOME")
    return folder if folder.is_absolute() and (named or _home()) else None


def cache_folder() -> Path | None:
    """Of this tool; None where the user has none."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    home = _home()
    if named.is_absolute():
        return named / "dfrf"
    return home / ".cache" / "dfrf" if home else None


def keep_findings() -> None:
    """Keep what is found out about files in this user's caches, for later runs of this version."""
    import dubbing
    from dubbing.engine.disk.files import digest_data
    from dubbing.engine.disk.unchanged import keep_in

    if (folder := cache_folder()) is not None:
        sources = sorted(Path(next(iter(dubbing.__path__))).rglob("*.py"))
        code = [[str(path), path.stat().st_mtime_ns] for path in sources]
        keep_in(folder / "files.json", digest_data([sys.version, metadata.version("av"), code]))


def _home() -> Path | None:
    """The user's home; one that is not known would be a folder called ``~`` or the root."""
    home = os.path.expanduser("~")
    known = os.path.isabs(home) and os.environ.get("HOME") != ""
    return Path(home) if known else None
