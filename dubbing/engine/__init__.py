"""How any graph of stages is brought up to date: by one process, by several, on other machines."""
