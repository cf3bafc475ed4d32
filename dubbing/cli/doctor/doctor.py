"""Checks of this machine and of the installation. What may be missing is imported late."""

import hashlib
import platform
import sys
from base64 import urlsafe_b64encode
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from dubbing import packages
from dubbing.cli.doctor import hardware
from dubbing.cli.doctor.finding import Finding
from dubbing.cli.doctor.self_tests import self_tests
from dubbing.errors import MediaError

PYTHONS = ((3, 11), (3, 14))  # the oldest and the newest that torch and all others have wheels for
OURS = ("dfrf", "dubbing")  # folders of the packages
OTHER_OPENCVS = ("opencv-python", "opencv-python-headless", "opencv-contrib-python")


def examine() -> list[Finding]:
    """Look at everything a run needs."""
    looks: tuple[Callable[[], Finding], ...] = (
        *(_python, _dfrf, _torch),
        *(hardware.graphics, hardware.processor, hardware.memory, hardware.disk),
        *(_ffmpeg, _packages, _opencv),
    )
    return [*(look() for look in looks), *self_tests()]


def _python() -> Finding:
    found = platform.python_version()
    oldest, newest = PYTHONS
    if oldest <= sys.version_info[:2] <= newest:
        return Finding("Python", "fine", found)
    wanted = f"{'.'.join(map(str, oldest))} to {'.'.join(map(str, newest))}"
    return Finding(
        "Python", "slow", found, f"install dfrf with Python {wanted}: others are untried"
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _dfrf() -> Finding:
    """Compares the files of dfrf with the digests that were recorded when they were installed."""
    if not (version := _version("dfrf")):
        return Finding("dfrf", "slow", "run from its folder without having been installed")
    files = [path for path in metadata.files("dfrf") or () if path.parts[0] in OURS]
    damaged = [path.name for path in files if not _whole(path)]
    if not damaged:
        return Finding("dfrf", "fine", version)
    text = f"{version}; changed or gone since it was installed: {', '.join(damaged)}"
    return Finding("dfrf", "lacking", text, packages.again("dfrf"))


def _whole(path: metadata.PackagePath) -> bool:
    if path.hash is None:
        return True
    try:
        digest = hashlib.new(path.hash.mode, Path(path.locate()).read_bytes()).digest()
    except OSError:
        return False
    return urlsafe_b64encode(digest).rstrip(b"=").decode() == path.hash.value


def _torch() -> Finding:
    if found := _version("torch"):
        return Finding("torch", "fine", found)
    return Finding("torch", "lacking", "not installed", packages.command(["torch"]))


def _ffmpeg() -> Finding:
    try:
        from dubbing.media.opening import ffmpeg
    except ImportError as error:
        command = packages.command([error.name or "ffmpeg"])
        return Finding("ffmpeg", "lacking", f"{error.name} is not installed", command)
    try:
        return Finding("ffmpeg", "fine", f"{ffmpeg.version()} ({ffmpeg.binary()})")
    except MediaError as error:
        return Finding("ffmpeg", "lacking", error.what, error.remedy)


def _packages() -> Finding:
    gone = packages.missing()
    if not gone:
        return Finding("packages", "fine", "all that are declared")
    return Finding("packages", "lacking", f"without {', '.join(gone)}", packages.command(gone))


def _opencv() -> Finding:
    others = [name for name in OTHER_OPENCVS if _version(name)]
    found = _version("opencv-contrib-python-headless")
    if found and not others:
        return Finding("OpenCV", "fine", found)
    if not found:
        return Finding("OpenCV", "lacking", "not installed", packages.command(["cv2"]))
    both = f"{', '.join(others)} overwrites its files"
    return Finding(
        "OpenCV", "lacking", both, packages.instead("opencv-contrib-python-headless", others)
    )
