"""The work of each stage, as it is planned: plain data, which is called when its turn comes."""

from dubbing.tasks.check import Check, offset_of
from dubbing.tasks.dub import Composite, CueHeads, Listen, Render, Sign, pose_index
from dubbing.tasks.person import Finetune, Prepare, Prepared, RefinePoses, iterations_of

__all__ = [
    "Check",
    "Composite",
    "CueHeads",
    "Finetune",
    "Listen",
    "Prepare",
    "Prepared",
    "RefinePoses",
    "Render",
    "Sign",
    "iterations_of",
    "offset_of",
    "pose_index",
]
