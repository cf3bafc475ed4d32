"""A prepared clip in half as many pixels each way, for drafts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Self

import cv2
import numpy as np

from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking import cropping

MOST_PX = 256  # side of a draft's crop


@dataclass(frozen=True, kw_only=True)
class HalvedClip(PreparedClip):
    """A prepared clip, its film and its crop at half their size.

    Attributes:
        full: the clip.
        scale, shift: (T, 1), (T, 2): a place p in px of the full crop is at scale p + shift here.
    """

    full: PreparedClip
    scale: np.ndarray
    shift: np.ndarray

    @classmethod
    def of(cls, clip: PreparedClip) -> Self:
        """A clip at half its size; windows into its film have whole pixels there, too.

        Its crop has `MOST_PX` at most: a larger one takes longer than a second for a second.
        """
        size, window = min(clip.size // 2, MOST_PX), np.floor(clip.crop / [2, 2, 2, 1])
        zoom = size / window[:, 2:3]
        scale = clip.crop[:, 2:3] / clip.size * zoom / 2
        shift = (clip.crop[:, :2] / 2 - window[:, :2]) * zoom + scale / 2 - 0.5
        same = {field.name: getattr(clip, field.name) for field in fields(clip)}
        noise = clip.noise.copy()
        noise[:, :3] /= 2  # the mean of four pixels
        noise[:, -1] = 0
        return cls(
            **same
            | {
                "size": size,
                "source_size": tuple(side // 2 for side in clip.source_size),
                "focal": clip.focal * float(np.median(scale)),
                "crop": window,
                "centre": clip.centre * scale + shift,
                "landmarks": clip.landmarks * scale[:, None] + shift[:, None],
                "lip_shift": clip.lip_shift * scale[:, None],
                "noise": noise,
            },
            full=clip,
            scale=scale,
            shift=shift,
        )

    @property
    def pixels(self) -> None:
        """A draft is made of RGB pictures."""
        return None

    def whole_frames(self, start: int = 0, count: int | None = None) -> Iterator[np.ndarray]:
        """See `PreparedClip.whole_frames`."""
        for whole in self.full.whole_frames(start, count):
            yield cv2.resize(whole, self.source_size, interpolation=cv2.INTER_AREA)

    def film_frames(self, start: int = 0, count: int | None = None) -> Iterator[FilmFrame]:
        """See `PreparedClip.film_frames`."""
        for k, frame in enumerate(self.full.film_frames(start, count), start):
            turn = np.concatenate([np.eye(2) * self.scale[k], self.shift[k][:, None]], 1)
            halve = partial(
                cv2.warpAffine, M=turn, dsize=(self.size,) * 2, borderMode=cv2.BORDER_REPLICATE
            )
            whole = cv2.resize(frame.whole, self.source_size, interpolation=cv2.INTER_AREA)
            yield replace(
                frame,
                image=cropping.crop(whole, self.crop[k], self.size),
                matte=halve(frame.matte),
                fill=halve(frame.background),
                overlay=None if frame.overlay is None else halve(frame.overlay),
                noise=self.noise[k],
                motion=frame.motion * self.scale[k],
                landmarks=self.landmarks[k],
                whole=whole,
            )
