"""Findings of `doctor` about the machine: processor, graphics card, memory, disk."""

import ctypes
import importlib.util
import os
import shutil
from pathlib import Path

from dubbing import packages
from dubbing.cli.doctor.finding import Finding

ENOUGH_MEMORY, ENOUGH_DISK = 6.0, 5.0  # GiB


def graphics() -> Finding:
    """The graphics card that `--device auto` chooses."""
    if importlib.util.find_spec("torch") is None:
        command = packages.command(["torch"])
        return Finding("graphics card", "lacking", "torch is not installed", command)
    import torch

    if torch.cuda.is_available():
        memory = torch.cuda.get_device_properties(0).total_memory / 2**30
        name = torch.cuda.get_device_name(0)
        return Finding("graphics card", "fine", f"{name}, {memory:.0f} GiB")
    if torch.backends.mps.is_available():
        return Finding("graphics card", "slow", "Apple's is not used; the processor does it all")
    return Finding("graphics card", "slow", "none; the processor does it all")


def processor() -> Finding:
    """Cores for this process, and whether they multiply in bfloat16."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    except OSError:
        return Finding("processor", "fine", f"{cores} cores")
    fast = [name for name in ("amx_bf16", "avx512_bf16") if name in flags]
    text = f"{cores} cores, bfloat16: {', '.join(fast) or 'no'}"
    return Finding("processor", "fine" if fast else "slow", text)


def memory() -> Finding:
    """Memory of the machine."""
    size = _memory_bytes() / 2**30
    text = f"{size:.1f} GiB"
    if size >= ENOUGH_MEMORY:
        return Finding("memory", "fine", text)
    return Finding("memory", "slow", text, "set a smaller size for the identities, and --jobs 1")


def _memory_bytes() -> float:
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    size = ctypes.c_ulonglong()  # KiB
    library = ctypes.windll.kernel32  # type: ignore[attr-defined]
    library.GetPhysicallyInstalledSystemMemory(ctypes.byref(size))
    return size.value * 1024


def disk() -> Finding:
    """Free space in the current folder."""
    free = shutil.disk_usage(Path.cwd()).free / 2**30
    text = f"{free:.0f} GiB free here"
    if free >= ENOUGH_DISK:
        return Finding("disk", "fine", text)
    return Finding("disk", "lacking", text, "choose an output folder on a larger disk")
