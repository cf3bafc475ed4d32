"""The head of a person: its model is fine-tuned, refines the poses of clips, and is rendered."""
