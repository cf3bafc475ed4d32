"""Training of a model: `fit`, augmentation, regularizers, lip supervision, validation."""
