"""The interface for researchers loads without torch, and a frame takes its inputs."""

import subprocess
import sys

import pytest
import torch

import dfrf
from dfrf.data.reference_cuts import cut_references
from tests.dfrf.people import SIZE, person, random_model


def test_a_frame_follows_the_expression() -> None:
    dataset, (model, _) = person(), random_model()
    head = dfrf.Head.of(model, cut_references(dataset, torch.tensor([0, 5])))
    camera = dfrf.Camera(dataset.c2w[2], dataset.focal, dataset.centres[2], SIZE)
    calm, _ = dfrf.render_frame(head, camera)
    raised = torch.zeros(1, 6)
    raised[:, 2:4] = 3.0
    moved, _ = dfrf.render_frame(head, camera, expression=raised)
    again, _ = dfrf.render_frame(head, camera, expression=torch.zeros(1, 6))
    assert torch.equal(calm, again)
    assert (moved - calm).abs().max() > 0.01


def test_the_interface_loads_without_torch() -> None:
    code = "import sys, dfrf; dir(dfrf); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    with pytest.raises(AttributeError, match="nothing"):
        _ = dfrf.nothing
    assert all(hasattr(dfrf, name) for name in dfrf.__all__)
