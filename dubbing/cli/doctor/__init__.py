"""Whether this machine and this installation can dub."""
