"""Names of the stages in the order in which a run does them, for the command line too."""

OF_IDENTITY = ("prepare", "source", "finetune")
OF_DUB = ("speech", "heads", "video", "sync")
