"""Where the weights of the sync check lie; kept apart so that nobody loads torch to name them."""

from pathlib import Path

SYNC_WEIGHTS = Path(__file__).with_name("weights.safetensors")
