"""Before any test imports dfrf: the shapes in its signatures are checked at every call."""

import os
import tempfile

from jaxtyping import install_import_hook

import tests.shapes  # noqa: F401 - the hook below finds it by its name

install_import_hook(["dfrf"], "tests.shapes.checked")

# The key of the invisible mark that tests make, and caches: not in the folders of who runs them.
SETTINGS = tempfile.TemporaryDirectory()
os.environ["XDG_CONFIG_HOME"] = os.environ["XDG_CACHE_HOME"] = SETTINGS.name
