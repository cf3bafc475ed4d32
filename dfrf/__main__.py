"""`python -m dfrf`: the tool of that name, as `python -m dubbing`.

Nothing imports this file, so the method does not depend on the tool.
"""

import runpy

if __name__ == "__main__":
    runpy.run_module("dubbing", run_name="__main__")
