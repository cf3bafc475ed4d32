"""The weights that stages declare are those that their code reads."""

from __future__ import annotations

import re
from pathlib import Path

from dubbing.batch import jobs
from dubbing.engine.graph.code_version import file_of, reachable
from dubbing.engine.graph.stage import Stage
from dubbing.manifest.manifest import load
from dubbing.shipped.base import BASE
from dubbing.speech.weight_paths import files_of
from dubbing.stages.base import DubbingStage
from tests import clips
from tests.dubbing.batches import manifest_of


def stages_of(path: Path) -> list[Stage]:
    built = jobs.build(load(path))
    return [stage for job in built.all() for stage in job.stages.values()]


def manifest(tmp_path: Path, extra: str = "") -> Path:
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 1.0)
    path = manifest_of(tmp_path, tmp_path, {"ann": "ann.mp4"})
    path.write_text(path.read_text().replace("seconds: 1,", f"seconds: 1, {extra}"))
    return path


def test_every_weights_file_of_the_package_is_an_input_of_who_reads_it(tmp_path: Path) -> None:
    """A module that names a file of weights reads it, if the code of a stage comes there."""
    hands = {"hand_detector", "hand_landmarks"}
    faces = {"face_detector", "face_landmarks", "person_mask"}
    not_read = {  # where a module that reads weights is imported for something else
        "refine_poses": {"encoder", "filter", "acoustic_weights", "voice_detector", *faces},
        "finetune": faces,
        "render": {"encoder", "filter", "acoustic_weights", "voice_detector"},
        "prepare": {"acoustic_weights", "voice_detector", *hands},
        "check": {"person_mask", *hands},
        "check_source": {"person_mask", *hands},
    }
    for stage in stages_of(manifest(tmp_path)):
        named = set()
        modules = reachable(
            type(stage).__module__, DubbingStage.packages, DubbingStage.without_effect
        )
        for module in modules:
            file = file_of(module)
            assert file is not None
            for name in re.findall(r'with_name\("(\w+\.safetensors)"\)', file.read_text()):
                named |= {file.with_name(name)}
        read = {source for source in stage.inputs.values() if isinstance(source, Path)}
        left = {path.stem for path in named - read if path != BASE}
        assert left == not_read.get(stage.kind, set()), stage.kind


def test_all_files_of_a_models_folder_count(tmp_path: Path) -> None:
    folder = tmp_path / "hub"
    folder.mkdir()
    (folder / "config.json").write_text('{"model_type": "hubert"}')
    for name in ("model.safetensors.index.json", "model-1.safetensors", "model-2.safetensors"):
        (folder / name).write_text(name)
    (folder / ".DS_Store").write_text("of a file manager")
    path = manifest(tmp_path, "speech: hubert, speech_weights: hub,")
    before = {stage.kind: stage.key() for stage in stages_of(path) if stage.kind == "listen"}
    for name in files_of(folder):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace("}", ', "x": 1}') if "config" in name else "other")
        assert {s.kind: s.key() for s in stages_of(path) if s.kind == "listen"} != before, name
        (folder / name).write_text(text)
    (folder / ".DS_Store").write_text("other")
    assert {s.kind: s.key() for s in stages_of(path) if s.kind == "listen"} == before
