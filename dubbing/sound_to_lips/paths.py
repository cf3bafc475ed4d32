"""Where the shipped weights lie; kept apart so that nobody loads torch to name them."""

from pathlib import Path

DEFAULT_WEIGHTS = Path(__file__).with_name("weights.safetensors")
