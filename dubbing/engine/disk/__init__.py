"""How results lie on disk: whole files, their digests, and claims on folders."""
