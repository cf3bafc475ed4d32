"""Work that no dub needs: training of what ships, the synthetic speaker, measuring, timing."""
