"""Cells that show nothing are closed, and the picture stays."""

import pytest
import torch

from dfrf import presets
from dfrf.cameras import Camera
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.baking import prune
from dfrf.field.field import PRIOR_CENTRE, PRIOR_RADII
from dfrf.rendering.volume_rendering import render_rays
from tests.dfrf.people import FOCAL, SIZE, person, small_config


@pytest.mark.usefixtures("arithmetic")
def test_pruning_closes_air_and_leaves_the_picture() -> None:
    someone = person()
    model = presets.build(small_config()).eval()
    centre, radii = torch.tensor(PRIOR_CENTRE), torch.tensor(PRIOR_RADII)
    reach = ((model.grid.centres() - centre) / radii).norm(dim=-1)
    model.grid.start_from((reach > 0.8) & (reach < 1.4))
    open_before = float(model.grid.occupied.float().mean())
    conditioning = torch.randn(6, 70)
    camera = Camera(someone.c2w[2], FOCAL, someone.centres[2], SIZE)
    rays = camera.rays(torch.arange(SIZE * SIZE))
    with torch.no_grad():
        maps = model.field.encoder(cut_references(someone, torch.tensor([0, 5])))

        def picture() -> torch.Tensor:
            seen = render_rays(model.volume(conditioning[:1], maps), rays)
            return torch.cat([seen.colour, seen.opacity[:, None]], 1)

        before = picture()
        prune(model, conditioning, someone.c2w[:, :, 3], maps, torch.Generator().manual_seed(0))
        after = picture()
    assert 0.3 * open_before < model.grid.occupied.float().mean() < 0.8 * open_before
    assert before[:, 3].max() > 0.95
    assert (before - after).abs().mean() < 0.003
    assert (before - after).abs().max() < 0.1
