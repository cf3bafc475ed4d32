"""Before any test imports dfrf: the shapes in its signatures are checked at every call.

And which files hold tests that take seconds: `make test-fast` leaves them out.
"""

import os
import tempfile
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

import tests.shapes  # noqa: F401 - the hook below finds it by its name

install_import_hook(["dfrf"], "tests.shapes.checked")

HERE = Path(__file__).parent
# The key of the invisible mark that tests make: not in the folder of who runs them.
SETTINGS = tempfile.TemporaryDirectory()
os.environ["XDG_CONFIG_HOME"] = SETTINGS.name
MEDIUM = (
    "attack/",
    "dfrf/rendering/test_frame_renderer.py",
    "dfrf/rendering/test_pose_refinement.py",
    "dfrf/published/test_paper_method.py",
    "dfrf/test_gpu.py",
    "dfrf/training/test_augmentation.py",
    "dfrf/training/test_fit.py",
    "dfrf/training/test_lip_supervision.py",
    "dfrf/training/test_step.py",
    "dfrf/training/test_validation.py",
    "dubbing/workshop/bench/",
    "dubbing/cli/test_doctor.py",
    "dubbing/cli/test_dub.py",
    "dubbing/cli/test_main.py",
    "dubbing/cli/test_output.py",
    "dubbing/engine/test_cluster.py",
    "dubbing/engine/test_part.py",
    "dubbing/engine/test_runner.py",
    "dubbing/workshop/lab/",
    "dubbing/manifest/test_scenes.py",
    "dubbing/manifest/test_yaml_lines.py",
    "dubbing/media/test_colour.py",
    "dubbing/media/test_muxing.py",
    "dubbing/media/test_opening.py",
    "dubbing/media/test_reading.py",
    "dubbing/media/test_tracks.py",
    "dubbing/mixing/",
    "dubbing/preparation/alignment/test_photometric.py",
    "dubbing/preparation/test_prepare.py",
    "dubbing/preparation/tracking/test_occlusion.py",
    "dubbing/provenance/test_mark_search.py",
    "dubbing/provenance/test_verify.py",
    "dubbing/speech/test_rnn_features.py",
    "dubbing/speech/test_transformer_features.py",
    "dubbing/stages/test_clip_speech.py",
    "dubbing/stages/test_composite.py",
    "dubbing/stages/test_face_of_the_frame.py",
    "dubbing/stages/test_finetune.py",
    "dubbing/stages/test_paper_preset.py",
    "dubbing/stages/test_refine_poses.py",
    "dubbing/stages/test_render.py",
    "dubbing/sync/syncnet/",
    "dubbing/sync/test_check.py",
    "dubbing/sync/test_sound_channels.py",
    "dubbing/workshop/synthetic/",
    "dubbing/batch/",
    "dubbing/test_packages.py",
    "dubbing/test_researchers.py",
    "dubbing/workshop/training/",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.relative_to(HERE).as_posix().startswith(MEDIUM):
            item.add_marker("medium")
