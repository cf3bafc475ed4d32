"""The packages a run needs, as dfrf declares them, and what to run where one is missing.

Only their specifications are looked up, so that nothing is loaded. Standard library only: this is
for machines on which the installation went wrong. Much of it is loaded late: each command has this.
"""

import sys
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from dubbing.errors import ExplainedError

# Modules of packages that are not named as the package is.
MODULES = {
    "c2pa-python": "c2pa",
    "ffmpeg-python": "ffmpeg",
    "opencv-contrib-python-headless": "cv2",
    "opencolorio": "PyOpenColorIO",
    "openimageio": "OpenImageIO",
    "pillow": "PIL",
    "ruamel.yaml": "ruamel.yaml",
    "scikit-image": "skimage",
}
# Files that an installer leaves in the environment of a tool.
PIPX_RECORD, UV_RECORD = "pipx_metadata.json", "uv-receipt.toml"


@lru_cache(maxsize=8)
def declared(extra: str = "") -> dict[str, str]:
    """Module and requirement of what dfrf declares for every run, or for an extra alone.

    Empty where dfrf runs from its folder without having been installed.
    """
    import re
    from importlib import metadata

    try:
        texts = metadata.requires("dfrf") or []
    except metadata.PackageNotFoundError:
        return {}
    found = {}
    for text in texts:
        requirement, _, marker = text.partition(";")
        of = re.search(r"\bextra == ['\"](.+?)['\"]", marker)
        if (of[1] if of else "") == extra and _applies(marker):
            (package,) = re.findall(r"^[\w.-]+", requirement)
            found[_module(package)] = requirement.strip()
    return found


def missing(extra: str = "") -> list[str]:
    """Modules that cannot be found, those of an extra among them."""
    return [*missing_of(""), *(missing_of(extra) if extra else ())]


def missing_of(extra: str) -> list[str]:
    """Modules that an extra adds and that cannot be found."""
    return [name for name in declared(extra) if not _is_there(name)]


def lacking(names: list[str]) -> ExplainedError:
    """The error for missing modules, with the command that installs them."""
    return ExplainedError(f"not installed: {', '.join(names)}", remedy=f"run {command(names)}")


def require(extra: str = "") -> None:
    """Looks for every package, those of an extra too, before any work.

    Raises:
        ExplainedError: some are missing.
    """
    if names := missing(extra):
        raise lacking(names)


def require_renderer() -> None:
    """Looks for every package, and for the renderer of the synthetic speaker.

    Raises:
        ExplainedError: some are missing, or there is no Embree for this processor.
    """
    require()
    if not _is_there("embreex"):
        what = "the synthetic speaker needs Embree, which is not packaged for this processor"
        raise ExplainedError(what, remedy="dub a film of your own, or run it on another machine")


def command(names: list[str]) -> str:
    """The command that installs these modules into the environment that runs this.

    A module that dfrf does not declare belongs to a package that another one needs: installing all
    of them again, with what they need, brings it.
    """
    from importlib import metadata

    extras = (metadata.metadata("dfrf").get_all("Provides-Extra") or []) if declared() else []
    known = {**declared()}
    for extra in extras:
        known |= declared(extra)
    if all(name in known for name in names):
        return in_words([*installer(), *(known[name] for name in names)])
    return in_words([*installer(), *(declared().values() or names)])


def again(package: str) -> str:
    """The command that installs a package, dfrf itself or one that it needs, once more."""
    if tool := _tool():
        return tool
    call = installer()
    one = (
        ["--reinstall-package", package] if call[0] == "uv" else ["--force-reinstall", "--no-deps"]
    )
    wanted = declared().get(_module(package), package)
    return in_words([*call, *one, *(_origin() if package == "dfrf" else [wanted])])


def instead(package: str, others: list[str]) -> str:
    """The command that removes packages that overwrite another, and installs that once more."""
    if tool := _tool():
        return tool
    call = ["uninstall" if word == "install" else word for word in installer()]
    yes = [] if call[0] == "uv" else ["-y"]
    return f"{in_words([*call, *yes, *others])} && {again(package)}"


def _tool() -> str:
    """The command that makes the environment of a tool once more; '' for other environments."""
    if (Path(sys.prefix) / PIPX_RECORD).exists():
        return "pipx reinstall dfrf"
    return "uv tool upgrade --reinstall dfrf" if (Path(sys.prefix) / UV_RECORD).exists() else ""


def installer() -> list[str]:
    """The command that adds packages to the environment that runs this, as it was made."""
    if (Path(sys.prefix) / PIPX_RECORD).exists():
        return ["pipx", "inject", "dfrf"]
    from shutil import which

    here = ["--python", sys.executable]
    if (Path(sys.prefix) / UV_RECORD).exists():
        return ["uv", "pip", "install", *here]
    if find_spec("pip"):
        return [sys.executable, "-m", "pip", "install"]
    # An environment without pip is one of uv's, or is filled by a pip outside of it.
    return ["uv", "pip", "install", *here] if which("uv") else ["pip", *here, "install"]


def _origin() -> list[str]:
    """The source that dfrf was installed from, for pip: its folder, or its name in a registry."""
    import json
    from importlib import metadata
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        record = metadata.distribution("dfrf").read_text("direct_url.json")
    except metadata.PackageNotFoundError:
        record = None
    found = json.loads(record) if record else {}
    if not found.get("url", "").startswith("file:"):
        return ["dfrf"]
    path = url2pathname(urlsplit(found["url"]).path)
    return ["-e", path] if found.get("dir_info", {}).get("editable") else [path]


def in_words(words: list[str]) -> str:
    """A command as it is typed."""
    import shlex

    if sys.platform == "win32":
        return " ".join(f'"{word}"' if set(word) & set(" <>") else word for word in words)
    return shlex.join(words)


def _module(package: str) -> str:
    return MODULES.get(package, package.replace("-", "_"))


def _applies(marker: str) -> bool:
    """Whether a requirement is one of this machine's; nothing but Embree has such a condition."""
    import re
    from platform import machine

    excluded = re.search(r"platform_machine != ['\"](.+?)['\"]", marker)
    return excluded is None or excluded[1] != machine()


def _is_there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # what a dotted name lies in
        return False
