"""Path of the sync check's weights; a module without torch, so that naming them is fast."""

from pathlib import Path

SYNC_WEIGHTS = Path(__file__).with_name("weights.safetensors")
