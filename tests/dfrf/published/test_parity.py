"""The published code's own numbers, from its own weights (facts: README of the parity folder).

Slots start without noise where nothing else is said. Positions there are (row, column).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pytest
import torch
import torch.nn.functional as F
from safetensors.torch import load_file
from torch import Tensor

from dfrf.cameras import pixel_grid, pixel_rays, project
from dfrf.field.encodings import frequency_encoding
from dfrf.published.conditioned_field import EncodedReferences, FrameConditions, References
from dfrf.published.paper_model import PaperModel
from dfrf.published.references import clamp_to_image
from dfrf.saved_models import load_model
from dubbing.workshop.published.importing import import_checkpoint
from tests import needs

SIZE, FOCAL = 64, 162.5
CLOSE: dict[str, Any] = {"atol": 1e-4, "rtol": 0}

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Published:
    """Numbers to reproduce, and our model with the weights they came from."""

    numbers: dict[str, Tensor]
    model: PaperModel
    references: References

    def rays(self) -> tuple[Tensor, Tensor]:
        """Rays of the rendered frame, row by row."""
        pixels = pixel_grid(SIZE, SIZE).reshape(-1, 2)
        return pixel_rays(self.numbers["render_pose"], FOCAL, self.references.centre[0], pixels)


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Published:
    out = tmp_path_factory.mktemp("parity") / "imported.safetensors"
    import_checkpoint(needs.shared("parity") / "published_weights.safetensors", out)
    numbers = load_file(needs.shared("parity") / "published_outputs.safetensors")
    centre = torch.full((1, 2), SIZE / 2)
    images, poses = numbers["reference_images"], numbers["reference_poses"]
    imported, _ = load_model(out)
    assert isinstance(imported, PaperModel)
    assert imported.config.slot_noise
    model = PaperModel(replace(imported.config, slot_noise=False)).eval()
    model.load_state_dict(imported.state_dict())
    return Published(numbers, model, References(images, poses, FOCAL, centre))


@pytest.fixture(scope="module")
def maps(published: Published) -> EncodedReferences:
    with torch.no_grad():
        return published.model.encode(published.references)


@torch.no_grad()
def test_speech(published: Published) -> None:
    numbers, model = published.numbers, published.model
    windows = numbers["audio_windows"]
    torch.testing.assert_close(model.audio(windows), numbers["audio_codes"], **CLOSE)
    torch.testing.assert_close(model.speech_code(windows), numbers["audio_feature"], **CLOSE)


@torch.no_grad()
def test_reference_features(published: Published, maps: EncodedReferences) -> None:
    sample = maps.features[:, ::16, ::16]
    torch.testing.assert_close(sample, published.numbers["reference_features_sample"], **CLOSE)


@torch.no_grad()
def test_projections_and_offsets(published: Published, maps: EncodedReferences) -> None:
    numbers, views = published.numbers, published.references
    points = numbers["points"]
    seen = project(points, views.c2w, views.focal, views.centre)
    seen = clamp_to_image(seen, SIZE, SIZE)
    torch.testing.assert_close(seen.flip(-1), numbers["projection_row_col"], **CLOSE)
    encoded = frequency_encoding(points, 10)
    _, offset = published.model.field.look_up(points, encoded, numbers["audio_feature"], maps)
    # Next to a half, another rounding is no fault.
    clear = ((seen % 1 - 0.5).abs() > 1e-4).all(-1)
    assert clear.float().mean() > 0.99
    expected = numbers["warp_offset_row_col"]
    assert expected.abs().max() > 1
    torch.testing.assert_close(offset.flip(-1)[clear], expected[clear], **CLOSE)


@torch.no_grad()
def test_aggregated_feature_and_raw_output(published: Published, maps: EncodedReferences) -> None:
    numbers, fields = published.numbers, published.model.field
    origins, directions = (x[numbers["ray_index"].long()] for x in published.rays())
    points = origins[:, None] + directions[:, None] * numbers["z"][:, None]
    conditions = FrameConditions(numbers["audio_feature"], maps)
    out = fields(fields.coarse, points, F.normalize(directions, dim=-1), conditions)
    torch.testing.assert_close(out.feature, numbers["aggregated_feature"], **CLOSE)
    raw = torch.cat([out.colour, out.density[..., None]], -1)
    torch.testing.assert_close(raw, numbers["coarse_raw_rgb_density"], **CLOSE)


@torch.no_grad()
def test_slot_attention_from_noise(published: Published, monkeypatch: pytest.MonkeyPatch) -> None:
    slots = load_file(needs.shared("parity") / "published_slots.safetensors")
    tokens = slots["slot_features"].transpose(0, 1)
    points = slots["slot_encoded_points"].transpose(0, 1)
    aggregation = published.model.field.aggregation
    # There each reference was given a point of its own, which no model does.
    pairs = zip(tokens.split(1), points, strict=True)
    inputs = torch.cat([aggregation.embedded(token, point) for token, point in pairs])
    monkeypatch.setattr(aggregation, "embedded", lambda *_: inputs)
    for noise, name in (
        (slots["slot_noise"], "slot_output"),
        (torch.zeros(64, 2, 128), "slot_output_without_noise"),
        (None, "slot_output_without_noise"),
    ):
        torch.testing.assert_close(aggregation(tokens, points[0], noise), slots[name], **CLOSE)


@torch.no_grad()
def test_picture(published: Published, maps: EncodedReferences) -> None:
    numbers = published.numbers
    origins, directions = published.rays()
    near, far = numbers["near_far"].tolist()
    background = numbers["background"].reshape(-1, 3)
    expected = {
        "colour": numbers["image"].reshape(-1, 3),
        "coarse_colour": numbers["image_coarse"].reshape(-1, 3),
        "opacity": 1 - numbers["last_weight"].reshape(-1),
    }
    # Every other row of the picture, 128 rays at a time.
    every_other = torch.arange(SIZE * SIZE).view(SIZE, SIZE)[::2].flatten()
    for rows in every_other.split(128):
        seen = published.model(
            origins[rows],
            directions[rows],
            near,
            far,
            numbers["audio_windows"],
            maps,
            background[rows],
        )
        for name, values in expected.items():
            torch.testing.assert_close(seen[name], values[rows], atol=1e-3, rtol=0)
