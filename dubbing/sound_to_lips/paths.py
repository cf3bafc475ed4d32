"""Paths of the shipped weights; a module without torch, so that naming them is fast."""

from pathlib import Path

ENCODER_WEIGHTS = Path(__file__).with_name("encoder.safetensors")
FILTER_WEIGHTS = Path(__file__).with_name("filter.safetensors")
