"""Manifests: how one is read into a production, and how a first one is written."""
