"""Where this user's settings and caches lie: nowhere, for a user without a home folder."""

import os
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


def _home() -> Path | None:
    """The user's home; one that is not known would be a folder called ``~`` or the root."""
    home = os.path.expanduser("~")
    known = os.path.isabs(home) and os.environ.get("HOME") != ""
    return Path(home) if known else None
