"""Facts that all stages of a dub share."""

from __future__ import annotations

from dubbing.pipeline import STAGES
from dubbing.stages import KINDS
from dubbing.stages.base import DubbingStage


def test_a_record_names_the_versions_of_packages_and_programs() -> None:
    assert {"torch", "numpy", "dfrf", "ffmpeg"} <= {*DubbingStage.versions()}


def test_a_stage_is_named_as_its_file() -> None:
    assert sorted(KINDS) == sorted(stage.kind for stage in STAGES)
    assert all(stage.__module__ == f"dubbing.stages.{stage.kind}" for stage in STAGES)
