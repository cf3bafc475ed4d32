"""A person: frames to fine-tune on, their dataset and reference frames."""
