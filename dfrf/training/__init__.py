"""Training of a model: `fit`, augmentation, lip supervision, validation."""
