"""Preparation of a clip: head poses, head matte, restored background."""

from dubbing.preparation.prepare import prepare
from dubbing.preparation.prepared import PreparedClip

__all__ = ["PreparedClip", "prepare"]
