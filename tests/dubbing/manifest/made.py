"""Manifests that are written down, and what is wrong with them."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from dubbing.errors import ManifestError
from dubbing.manifest import schema
from dubbing.manifest.keys import yaml_lines
from dubbing.manifest.manifest import load
from dubbing.production.production import Production
from tests import clips
from tests.dubbing.manifest.json_schema import errors

GOOD = f"""
version: 1
output: out
identities:
  host: {{clip: host.mp4, seconds: 2, consent: {clips.CONSENT}}}
dubs:
  - {{identity: host, audio: it.wav}}
"""


def read(folder: Path, text: str) -> Production:
    path = folder / "m.yaml"
    path.write_text(textwrap.dedent(text).lstrip("\n"))
    manifest = load(path)
    assert not list(errors(schema.build(), yaml_lines.read(path.read_text()).data))
    return manifest


def problems(folder: Path, text: str) -> list[str]:
    with pytest.raises(ManifestError) as caught:
        read(folder, text)
    return [str(problem) for problem in caught.value.problems]
