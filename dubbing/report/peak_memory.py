"""The most memory that this process has held."""

import sys


def peak_memory() -> int | None:
    """Bytes; None where the system does not report it (Windows)."""
    try:
        import resource
    except ModuleNotFoundError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak  # macOS counts bytes, Linux KiB
