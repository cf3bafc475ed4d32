"""The stages by name, in their order: where results lie and which module makes them.

The command line knows them without loading anything; `dubbing.pipeline` declares what each needs.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class StageKind:
    """Where a stage's results lie, and which module makes them."""

    folder: str
    module: str


# Beside the video of a composite: what became of the faces, what proves a scene, and what browsers
# play.
PICTURE_FILE, SCENE_FILE, PROXY_FILE = "picture.json", "scene.json", "proxy.mp4"
SYNC_FILE = "sync.json"
OF_IDENTITY = {
    "prepare": StageKind("prepared", "dubbing.preparation.prepare"),
    "check_source": StageKind("source_check", "dubbing.sync.check"),
    "finetune": StageKind("model", "dubbing.stages.finetune"),
    "refine_poses": StageKind("poses", "dubbing.stages.refine_poses"),
}
OF_DUB = {
    "listen": StageKind("speech", "dubbing.stages.listen"),
    "render": StageKind("render", "dubbing.stages.render"),
    "composite": StageKind("video", "dubbing.stages.composite"),
    "check": StageKind("check", "dubbing.sync.check"),
    "sign": StageKind("signed", "dubbing.provenance.credentials"),
}
KINDS = {**OF_IDENTITY, **OF_DUB}
STAGES = tuple(KINDS)
