"""`dfrf`, and `python -m dubbing`: the command line, or what to install where it does not load."""

import gc
import sys

from dubbing.engine import environment

# New objects after which Python looks for some that are of no use. Modules make hundreds of
# thousands, all of which stay: with its 700, looking takes a seventh of the time to load them.
GARBAGE_OBJECTS = 5000


def main() -> None:
    """Entry point. A package that is missing ends in one sentence."""
    environment.settle()  # before anything else is imported
    gc.set_threshold(GARBAGE_OBJECTS)
    from dubbing import packages

    try:
        from dubbing.cli.main import main as run

        run()
    except ModuleNotFoundError as error:
        name = error.name or ""
        if name.split(".")[0] in ("", "dubbing", "dfrf"):
            raise  # a bug of ours
        sys.exit(f"dfrf: {packages.lacking([name])}")
    except MemoryError:  # while all of it is loaded
        sys.exit("dfrf: memory ran short: end other programs, then run again")


if __name__ == "__main__":
    main()
