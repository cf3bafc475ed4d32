"""Dynamic facial radiance fields: tensors in, tensors out."""
