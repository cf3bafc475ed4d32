"""Search paths of this process, and of those that it starts: programs, libraries, modules.

Never in the current folder: what lies beside a film must not run because a command was called
there. In a search path an empty entry is the current folder, and a relative one lies in it.
"""

import os
import sys  # nothing else, or it could come from the current folder yet

# Where the top package lies that this module is part of.
PACKAGES = os.path.realpath(os.path.join(__file__, *[os.pardir] * (__name__.count(".") + 1)))
LIBRARIES = "LD_LIBRARY_PATH"
SAFE_PATH = "PYTHONSAFEPATH"  # where it is set, Python does not look for modules there
SEARCHED = ("PATH", "DIRS")  # ends of the names of variables that hold search paths


def settle() -> None:
    """Take the current folder out of all search paths of this process."""
    try:
        here = os.getcwd()
    except FileNotFoundError:
        here = ""
    sys.path[:] = [entry for entry in sys.path if entry == PACKAGES or entry not in ("", here)]
    for name, value in [*os.environ.items()]:
        if name.upper().endswith(SEARCHED):
            kept = [entry for entry in value.split(os.pathsep) if os.path.isabs(entry)]
            if kept:
                os.environ[name] = os.pathsep.join(kept)
            else:
                del os.environ[name]
    os.environ[SAFE_PATH] = "1"  # for what libraries start: multiprocessing runs `python -c`
    if os.name == "nt":
        os.environ["NODEFAULTCURRENTDIRECTORYINEXEPATH"] = "1"
    else:
        # OpenCV puts "FOLDER:" before what stands there when it is imported. With nothing behind
        # it that ends in an empty entry, so here is one: a folder without libraries.
        os.environ.setdefault(LIBRARIES, os.path.dirname(os.path.abspath(__file__)))


def of_children() -> dict[str, str]:
    """The environment of a process that is started; it finds our modules as this one does."""
    from sysconfig import get_path

    settle()
    found = {**os.environ}
    if PACKAGES not in (get_path("purelib"), get_path("platlib")):
        modules = [entry for entry in found.get("PYTHONPATH", "").split(os.pathsep) if entry]
        found["PYTHONPATH"] = os.pathsep.join(dict.fromkeys([*modules, PACKAGES]))
    return found


def python(module: str) -> list[str]:
    """The command that runs a module with Python, and finds none in the current folder."""
    return [sys.executable, "-P", "-m", module]
