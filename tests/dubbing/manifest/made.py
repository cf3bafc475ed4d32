"""Manifests that are written down, and what is wrong with them."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from dubbing.errors import ManifestError
from dubbing.manifest.manifest import Manifest, load
from tests import clips

GOOD = f"""
version: 1
output: out
identities:
  host: {{clip: host.mp4, seconds: 2, consent: {clips.CONSENT}}}
dubs:
  - {{identity: host, audio: it.wav}}
"""


def read(folder: Path, text: str) -> Manifest:
    path = folder / "m.yaml"
    path.write_text(textwrap.dedent(text).lstrip("\n"))
    return load(path)


def problems(folder: Path, text: str) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        read(folder, text)
    return [str(problem) for problem in caught.value.problems]
