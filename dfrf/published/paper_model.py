"""The model of the `paper` preset: parts assembled as in the published code, a frame at a time.

Published checkpoints load (see `importing`) and give the same images. References, warp and speech
can be left out.

R rays of one frame, S samples a ray, N references of H x W pixels, D speech features.
"""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar, Self

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from dfrf.config import from_plain
from dfrf.field.audio import AudioAttNet, AudioNet
from dfrf.model_interface import HeadModel
from dfrf.published import radiance_field as field
from dfrf.published import sampling
from dfrf.published import volume_rendering as volrend
from dfrf.published.conditioned_field import (
    EncodedReferences,
    FrameConditions,
    PaperConfig,
    PaperField,
    References,
)

TRAINING_SAMPLES = 2  # times as many as rendered: published training takes 64 + 128


class PaperModel(HeadModel):
    """The whole published model: speech, field, sampling, equation (8).

    Args:
        config: sizes, and what is left out; the published ones by default.
    """

    FAMILY: ClassVar[str] = "paper"
    config: PaperConfig

    def __init__(self, config: PaperConfig | None = None) -> None:
        super().__init__()
        self.config = config or PaperConfig()
        self.field = PaperField(self.config)
        if self.config.use_speech:
            self.audio = AudioNet(self.config.speech_dim, self.config.code_dim)
            self.smoothing = AudioAttNet(attended=self.config.code_dim // 2)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        return cls(from_plain(PaperConfig, values))

    def speech_code(
        self, windows: Float[Tensor, "K W D"] | None, smooth: bool = True
    ) -> Float[Tensor, " A"]:
        """A of a frame from the windows of frames i - 4 .. i + 3; empty without speech.

        Args:
            windows: see `data.neighbour_windows`.
            smooth: False takes the frame's own code, as published training does for 100,000 steps.

        Raises:
            ValueError: the model uses speech, but there are no windows.
        """
        if not self.config.use_speech:
            return next(self.parameters()).new_zeros(0)
        if windows is None:
            raise ValueError("this model needs speech windows")
        if not smooth:
            return self.audio(windows[windows.shape[0] // 2])
        return self.smoothing(self.audio(windows))

    def encode(self, references: References) -> EncodedReferences:
        """Runs the CNN over the references, once for all frames where they stay the same.

        One reference after the other; a backward pass runs it again instead of keeping all that
        was in between, a gigabyte for each at 512 pixels.
        """
        pairs = zip(references.images.split(1), references.c2w[:, :, 3].split(1), strict=True)
        maps = [
            checkpoint(self.field.encoder, *pair, use_reentrant=False, preserve_rng_state=False)
            for pair in pairs
        ]
        return EncodedReferences(torch.cat(maps), references)

    def render_pass(
        self,
        rays_o: Float[Tensor, "R 3"],
        rays_d: Float[Tensor, "R 3"],
        background: Float[Tensor, "R 3"],
        conditions: FrameConditions,
        network: field.RadianceMLP,
        depths: Float[Tensor, "R S"],
    ) -> dict[str, Tensor]:
        """Rendered rays of one pass, see `forward`; the last depth is the background's."""
        points = rays_o[:, None] + depths[:, :-1, None] * rays_d[:, None]
        length = rays_d.norm(dim=-1, keepdim=True)
        out = self.field(network, points, rays_d / length, conditions)
        alpha = volrend.opacities(field.density(out.density) * depths.diff(dim=-1) * length)
        rendered = volrend.composite(out.colour.sigmoid(), alpha, depths[:, :-1])
        return {
            "colour": rendered.over(background),
            "head": rendered.colour,
            "opacity": rendered.opacity,
            "depth": rendered.depth,
            "weights": rendered.weights,
            "depths": depths[:, :-1],
            "alpha": alpha,
            "offset": out.offset,
        }

    def forward(
        self,
        rays_o: Float[Tensor, "R 3"],
        rays_d: Float[Tensor, "R 3"],
        near: float,
        far: float,
        windows: Float[Tensor, "K W D"] | None,
        references: References | EncodedReferences | None,
        background: Float[Tensor, "R 3"],
        *,
        jitter: bool = False,
        smooth: bool = True,
        warp: bool = True,
        generator: torch.Generator | None = None,
    ) -> dict[str, Tensor]:
        """Renders rays of one frame twice: even samples, then more where those hit something.

        The last sample of a ray is the background, behind everything; no network computes it.

        Args:
            rays_o: origins.
            rays_d: directions whose component along the viewing axis is 1 (see `pixel_rays`).
            near: depth of the first sample.
            far: depth of the background.
            windows: speech of the frame and its neighbours; unused without speech.
            references: images, or features computed before; unused without references.
            background: colour behind the head, 0..1.
            jitter: True for training: samples are moved at random within their strata, and are
                `TRAINING_SAMPLES` times as many.
            smooth: see `speech_code`.
            warp: False in the coarse stage of training, equation (2) instead of (7).
            generator: of the random numbers of jitter and slots, on the device of the rays.

        Returns:
            `colour` (R, 3) over the background; `head` (R, 3) premultiplied, without it; `opacity`
            and `depth` (R,); of the fine samples `weights`, `depths` and `alpha` (R, S - 1) and
            `offset` (N, R, S - 1, 2; column, row in pixels of the reference); the same of the
            coarse pass under `coarse_...`.

        Raises:
            ValueError: references or windows are missing that the model needs.
        """
        maps: EncodedReferences | None = None
        if self.config.use_references:
            if references is None:
                raise ValueError("this model needs references")
            maps = self.encode(references) if isinstance(references, References) else references
        code = self.speech_code(windows, smooth)
        rays, config = rays_o.shape[0], self.config
        conditions = FrameConditions(code, maps, warp, self.training, generator)
        render = partial(self.render_pass, rays_o, rays_d, background, conditions)

        def uniform(count: int) -> Tensor:
            return torch.rand((rays, count), generator=generator, device=rays_o.device)

        times = TRAINING_SAMPLES if jitter else 1
        first, second = times * config.coarse_samples, times * config.fine_samples
        depths = sampling.stratified(
            rays_o.new_full((rays,), near),
            rays_o.new_full((rays,), far),
            first,
            uniform(first) if jitter else None,
        )
        coarse = render(self.field.coarse, depths)
        even = torch.linspace(0, 1, second, device=rays_o.device)[None]
        u = uniform(second) if jitter else even
        # The bins leave out the last sample, so the background's weight is any number.
        weights = F.pad(coarse["weights"].detach(), (0, 1))
        fine = render(self.field.fine, sampling.importance(depths, weights, u))
        return fine | {f"coarse_{name}": value for name, value in coarse.items()}
