"""Who signs content credentials."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Signer:
    """Two PEM files: a chain, the signer's certificate first, and the signer's private key."""

    certificate: Path
    key: Path
