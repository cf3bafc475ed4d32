"""Before any test imports dfrf: the shapes in its signatures are checked at every call."""

from jaxtyping import install_import_hook

import tests.shapes  # noqa: F401 - the hook below finds it by its name

install_import_hook(["dfrf"], "tests.shapes.checked")
