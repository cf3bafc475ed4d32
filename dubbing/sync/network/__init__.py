"""The network of the sync check: which mouths and sounds it takes, and its embeddings."""
