"""The head in one frame, as renderings of any kind offer it. S side of the image, R rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from jaxtyping import Bool
from torch import Tensor

from dfrf.cameras import Camera, Rays
from dfrf.rendering.frame_buffer import HeadImage
from dfrf.rendering.frame_renderer import render_frame
from dfrf.rendering.volume_rendering import SeenRays, Volume, render_rays


class FrameHead(Protocol):
    """The head in one frame."""

    def render(self, camera: Camera, region: Bool[Tensor, "S S"] | None = None) -> HeadImage:
        """Premultiplied colour in 0..1, and opacity.

        Args:
            camera: of the frame.
            region: the pixels that are needed; others may be left blank. None is all.
        """

    def see(self, rays: Rays) -> SeenRays:
        """Single rays, in the head frame."""


@dataclass(frozen=True)
class MarchedHead:
    """The head whose field is evaluated along every ray.

    Attributes:
        volume: the head as it is in that frame, the only one of its conditioning.
    """

    volume: Volume

    def render(self, camera: Camera, region: Bool[Tensor, "S S"] | None = None) -> HeadImage:
        """See `FrameHead`."""
        return render_frame(self.volume, camera, region)

    def see(self, rays: Rays) -> SeenRays:
        """See `FrameHead`."""
        return render_rays(self.volume, rays)
