"""Checks of this machine. Packages that may be missing are imported late."""

import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from dubbing import packages
from dubbing.errors import ExplainedError, MediaError
from dubbing.shipped.base import BASE

ENOUGH_MEMORY, ENOUGH_DISK = 6.0, 5.0  # GiB
PYTHONS = ((3, 11), (3, 12))


@dataclass(frozen=True)
class Finding:
    """One thing looked at. ``state``: fine, slow (works, but could be better) or lacking."""

    what: str
    state: str
    found: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything a run needs."""
    looks: tuple[Callable[[], Finding], ...] = (
        _python,
        _torch,
        _graphics,
        _arithmetic,
        _memory,
        _disk,
        _ffmpeg,
        _packages,
        _networks,
        _opencv,
        _base,
    )
    return [look() for look in looks]


def _python() -> Finding:
    found = platform.python_version()
    if sys.version_info[:2] in PYTHONS:
        return Finding("Python", "fine", found)
    return Finding("Python", "lacking", found, "install it again with Python 3.11 or 3.12")


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _torch() -> Finding:
    if found := _version("torch"):
        return Finding("torch", "fine", found)
    return Finding("torch", "lacking", "not installed", packages.command(["torch"]))


def _graphics() -> Finding:
    if importlib.util.find_spec("torch") is None:
        command = packages.command(["torch"])
        return Finding("graphics card", "lacking", "torch is not installed", command)
    import torch

    if torch.cuda.is_available():
        memory = torch.cuda.get_device_properties(0).total_memory / 2**30
        name = torch.cuda.get_device_name(0)
        return Finding("graphics card", "fine", f"{name}, {memory:.0f} GiB")
    return Finding("graphics card", "slow", "none; the processor does it all")


def _arithmetic() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    except OSError:
        flags = []
    fast = [name for name in ("amx_bf16", "avx512_bf16") if name in flags]
    text = f"{cores} cores, bfloat16: {', '.join(fast) or 'no'}"
    return Finding("processor", "fine" if fast else "slow", text)


def _memory() -> Finding:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    text = f"{memory:.1f} GiB"
    if memory >= ENOUGH_MEMORY:
        return Finding("memory", "fine", text)
    return Finding("memory", "slow", text, "set a smaller size for the identities, and --jobs 1")


def _disk() -> Finding:
    free = shutil.disk_usage(Path.cwd()).free / 2**30
    text = f"{free:.0f} GiB free here"
    if free >= ENOUGH_DISK:
        return Finding("disk", "fine", text)
    return Finding("disk", "lacking", text, "choose an output folder on a larger disk")


def _ffmpeg() -> Finding:
    try:
        from dubbing.media import ffmpeg
    except ImportError as error:
        command = packages.command([error.name or "ffmpeg"])
        return Finding("ffmpeg", "lacking", f"{error.name} is not installed", command)
    try:
        return Finding("ffmpeg", "fine", f"{ffmpeg.version()} ({ffmpeg.binary()})")
    except MediaError as error:
        return Finding("ffmpeg", "lacking", error.what, error.remedy)


def _networks() -> Finding:
    """Runs the networks that find faces and people on an image that the package knows."""
    try:
        from dubbing.face.graph_network import GraphNetwork
        from dubbing.face.weight_paths import FACE_WEIGHTS, PERSON_WEIGHTS
    except ImportError as error:
        command = packages.command([error.name or "torch"])
        return Finding("face networks", "lacking", f"{error.name} is not installed", command)
    paths = FACE_WEIGHTS | PERSON_WEIGHTS
    try:
        wrong = [name for name, path in paths.items() if not GraphNetwork(path).works()]
    except ExplainedError as error:
        return Finding("face networks", "lacking", error.what, error.remedy)
    if not wrong:
        return Finding("face networks", "fine", "compute what they should")
    text = f"{', '.join(wrong)}: other results than they should give"
    return Finding("face networks", "lacking", text, packages.command(["torch"]))


def _packages() -> Finding:
    gone = packages.missing()
    if not gone:
        return Finding("packages", "fine", "all that are declared")
    return Finding("packages", "lacking", f"without {', '.join(gone)}", packages.command(gone))


def _opencv() -> Finding:
    names = ("opencv-python", "opencv-python-headless", "opencv-contrib-python")
    others = [name for name in names if _version(name)]
    found = _version("opencv-contrib-python-headless")
    if found and not others:
        return Finding("OpenCV", "fine", found)
    if not found:
        return Finding("OpenCV", "lacking", "not installed", packages.command(["cv2"]))
    remove = f"python -m pip uninstall -y {' '.join(others)}"
    again = "python -m pip install --force-reinstall --no-deps opencv-contrib-python-headless"
    both = f"{', '.join(others)} overwrites its files"
    return Finding("OpenCV", "lacking", both, f"{remove} && {again}=={found}")


def _base() -> Finding:
    if BASE.is_file():
        return Finding("base checkpoint", "fine", f"{BASE.stat().st_size / 2**20:.1f} MiB")
    command = "install dfrf again, or name one with `base:` in the manifest"
    return Finding("base checkpoint", "slow", "none: people are learnt from nothing", command)
