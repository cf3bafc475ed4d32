"""Where the shipped weights lie; kept apart so that nobody loads torch to name them."""

from pathlib import Path

ENCODER_WEIGHTS = Path(__file__).with_name("encoder.safetensors")
FILTER_WEIGHTS = Path(__file__).with_name("filter.safetensors")
