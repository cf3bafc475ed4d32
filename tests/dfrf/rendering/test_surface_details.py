"""What references show of a surface without the field: the same as the field looks up there."""

import torch

from dfrf import device
from dfrf.fast.fast_method import FastMethod
from dfrf.field import mouth_pixels
from dfrf.field.conditioned_field import ConditionedField
from dfrf.rendering.surface_details import SurfaceDetails
from tests.dfrf.people import person, random_model


def details_with_mouths() -> tuple[SurfaceDetails, ConditionedField]:
    """Of a random model that also looks at views of mouths."""
    model, _ = random_model()
    method = FastMethod(model)
    maps = method.maps(method.reference_views(person(), torch.tensor([0, 5])))
    conditioning = 0.3 * torch.randn(1, model.config.field.cond_dim)
    field = ConditionedField(model.field, conditioning, maps).seen_from(torch.tensor([0, 0, 7.0]))
    details = SurfaceDetails.of(field)
    assert details is not None
    return details, field


@torch.no_grad()
def test_colours_at_anchors_are_those_that_the_field_blends(arithmetic: float) -> None:
    details, field = details_with_mouths()
    points = 0.3 * torch.randn(200, 3) + torch.tensor([0, -0.2, 0.8])
    directions = torch.nn.functional.normalize(points - torch.tensor([0, 0, 7.0]), dim=-1)
    share = mouth_pixels.share(details.maps, points)
    assert 20 < (share > 0).sum() < 180
    anchors = details.anchors(points, directions)
    assert anchors.shape == (200, details.anchor_count)
    frame = torch.zeros(200).long()
    with device.arithmetic(points.device):
        query = field.field.query(points, directions, frame, field.conditioning)
        _, blended, _ = field.field.fuse_references(
            query, details.maps, field.conditioning, True, share
        )
    shown = details.colours(points, anchors)
    # Colours, blend weights, their sum and the share of the mouth are each rounded once.
    most = 4 * arithmetic * float(blended.abs().max())
    torch.testing.assert_close(shown, blended, rtol=0, atol=most)
    # The mouth views take part: without them, other colours.
    faces = details.colours(points, anchors * (torch.arange(details.anchor_count) < 6))
    assert (faces - shown)[share > 0.5].abs().max() > 0.02


def test_a_field_without_references_has_no_details() -> None:
    model, _ = random_model()
    conditioning = torch.zeros(1, model.config.field.cond_dim)
    assert SurfaceDetails.of(ConditionedField(model.field, conditioning, None)) is None
