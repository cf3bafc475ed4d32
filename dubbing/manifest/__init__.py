"""Manifests: their keys, their mistakes, and the production that they describe."""
