"""The packages a run needs, and what to run where one is missing.

Only their specifications are looked up, so that nothing is loaded. Standard library only: this is
for machines on which the installation went wrong.
"""

import shlex
import sys
from importlib.util import find_spec

from dubbing.errors import ExplainedError

# What pyproject.toml declares: module and pinned package.
DECLARED = {
    "torch": "torch==2.13.0",
    "typer": "typer==0.29.2",
    "ffmpeg": "ffmpeg-python==0.2.0",
    "soundfile": "soundfile==0.14.0",
    "PIL": "pillow==13.0.0",
    "cv2": "opencv-contrib-python-headless==4.14.0.94",
    "skimage": "scikit-image==0.26.0",
    "tqdm": "tqdm==4.70.1",
    "pydantic": "pydantic==2.14.3",
    "ruamel.yaml": "ruamel.yaml==0.19.1",
    "imageio_ffmpeg": "imageio-ffmpeg==0.8.1",
    "av": "av==18.1.0",
    "rich": "rich==15.0.0",
    "scipy": "scipy==1.17.1",
    "numpy": "numpy==2.4.6",
    "safetensors": "safetensors==0.8.0",
    "jaxtyping": "jaxtyping==0.3.11",
    "jinja2": "Jinja2==3.1.6",
    "silero_vad": "silero-vad==6.2.3",
    "typing_extensions": "typing_extensions==4.16.0",
}
# What the extras of pyproject.toml add.
SYNTHETIC = {"embreex": "embreex==4.4.0.post1", "espeakng_loader": "espeakng-loader==0.2.4"}
CLUSTER = {"distributed": "distributed==2026.8.0"}
CREDENTIALS = {"c2pa": "c2pa-python==0.38.1", "cryptography": "cryptography==50.0.2"}
EXTRAS = {
    "cluster": CLUSTER,
    "synthetic": SYNTHETIC,
    "train": {**SYNTHETIC, "pocketsphinx": "pocketsphinx==5.1.1"},
    "c2pa": CREDENTIALS,
}


def missing(extra: str | None = None) -> list[str]:
    """Modules that cannot be found, those of an extra among them."""
    alone = [name for name in DECLARED if not _is_there(name)]
    return [*alone, *(missing_of(extra) if extra else ())]


def missing_of(extra: str) -> list[str]:
    """Modules that an extra adds and that cannot be found."""
    return [name for name in EXTRAS[extra] if not _is_there(name)]


def lacking(names: list[str]) -> ExplainedError:
    """The error for missing modules, with the command that installs them."""
    return ExplainedError(f"not installed: {', '.join(names)}", remedy=f"run {command(names)}")


def require(extra: str | None = None) -> None:
    """Looks for every package, those of an extra too, before any work.

    Raises:
        ExplainedError: some are missing.
    """
    if names := missing(extra):
        raise lacking(names)


def command(names: list[str]) -> str:
    """The command that installs these modules into the environment that runs this.

    A module that is not named here belongs to a package that another one needs: installing all of
    them again, with what they need, brings it.
    """
    pinned = DECLARED | EXTRAS["train"] | CLUSTER | CREDENTIALS
    known = [pinned[name] for name in names if name in pinned]
    if len(known) < len(names):
        known = list(DECLARED.values())
    return shlex.join([sys.executable, "-m", "pip", "install", *known])


def _is_there(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # what a dotted name lies in
        return False
