"""The shares of sources in the pixels of a dub, and how each part of the method changes its mouth.

Every colour of a baked head is a sum: of whole references, of mouth crops, and of the field's own
colour. So heads whose references or crops are painted white, and the rest black, show the shares.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dfrf.cameras import Camera
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.field.reference_encoder import MATTE
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.method_interface import FrameInputs
from dfrf.rendering.baked_frame import BakedHead
from dubbing.compositing.composite import blend, replacement
from dubbing.engine.graph.stage import Progress
from dubbing.heads import rendering as heads
from dubbing.heads.frame_inputs import inputs_of
from dubbing.heads.pose_refinement import refined
from dubbing.identity.best_seconds import Part
from dubbing.identity.dataset import mouth_boxes
from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from dubbing.video import composer
from dubbing.workshop.lab.cross_driving import frames_under

FRAMES = 50  # two seconds of speech
SOURCES = ("references", "crops", "own", "film", "plate")
LIKE = 100.0  # dB of pictures that are equal

Parts = tuple[FastModel, ReferenceMaps, FrameInputs]
Change = Callable[[FastModel, ReferenceMaps, FrameInputs], Parts]


def noise_for_speech(model: FastModel, maps: ReferenceMaps, inputs: FrameInputs) -> Parts:
    """Speech features are noise; the predicted lips stay."""
    noise = torch.randn(inputs.windows.shape, generator=torch.Generator().manual_seed(0))
    return model, maps, replace(inputs, windows=noise.to(inputs.windows))


def constant_lips(model: FastModel, maps: ReferenceMaps, inputs: FrameInputs) -> Parts:
    """The predicted lips, and what is heard beside them, are the mean of all frames."""
    mean = inputs.predicted_lips.mean(0, keepdim=True)
    return model, maps, replace(inputs, predicted_lips=mean.expand_as(inputs.predicted_lips))


def without_warp(model: FastModel, maps: ReferenceMaps, inputs: FrameInputs) -> Parts:
    """References are read where points project: equation (1) without (3) and (4)."""
    changed = copy.deepcopy(model)
    changed.field.config = replace(model.field.config, use_warp=False)
    return changed, maps, inputs


def without_crops(model: FastModel, maps: ReferenceMaps, inputs: FrameInputs) -> Parts:
    """The mouth comes from whole references, as the rest of the head."""
    return model, replace(maps, mouths=None), inputs


def ellipsoid(model: FastModel, maps: ReferenceMaps, inputs: FrameInputs) -> Parts:
    """The density is the one that a head begins with; it is marched, not baked."""
    changed = copy.deepcopy(model)
    with torch.no_grad():
        for parameter in changed.field.density.parameters():
            parameter.zero_()
    changed.open_where_skin_can_be()
    return changed, maps, replace(inputs, baked=False)


CHANGES: dict[str, Change] = {
    "speech noise": noise_for_speech,
    "no warp": without_warp,
    "no crops": without_crops,
    "constant lips": constant_lips,
    "ellipsoid": ellipsoid,
}


@dataclass(frozen=True)
class _Frames:
    """Some frames of a dub (F).

    Attributes:
        clip: with refined poses. numbers: (F,) of the clip's frames below.
        inputs: of all of them. maps: of the person. model: of the person.
    """

    clip: PreparedClip
    numbers: np.ndarray
    model: FastModel
    maps: ReferenceMaps
    inputs: FrameInputs

    def films(self) -> Iterator[FilmFrame]:
        return composer.read_frames(self.clip, self.numbers)

    def camera(self, k: int) -> Camera:
        inputs = self.inputs
        return Camera(inputs.c2w[k], inputs.focal, inputs.centres[k], inputs.size)

    def changed(self, change: Change) -> Iterator[np.ndarray]:
        """Heads (S, S, 4) uint8 after a change."""
        model, maps, inputs = change(self.model, self.maps, self.inputs)
        for colour, opacity in FastMethod(model).render_frames(inputs, maps):
            yield heads.to_rgba(colour, opacity)

    @torch.no_grad()
    def parts(self) -> Iterator[np.ndarray]:
        """(S, S, 4) float32: shares of references, crops and own colour in heads, and opacity."""
        own_heads = FastMethod(self.model).speaking_heads(self.inputs, self.maps)
        for k in range(len(self.numbers)):
            head = own_heads(k)
            assert isinstance(head, BakedHead)
            yield painted(head, self.camera(k))


def painted(head: BakedHead, camera: Camera) -> np.ndarray:
    """(S, S, 4): how much of a head's pixels is whole references, mouth crops, own; and opacity.

    Shares are premultiplied by opacity, and add up to it.
    """

    def of(whole: float, mouths: float) -> tuple[Tensor, Tensor]:
        images = replace(
            head.images,
            whole=with_colour(head.images.whole, whole),
            mouths=with_colour(head.images.mouths, mouths),
        )
        colour, opacity = replace(head, images=images).render(camera)
        return colour.mean(-1), opacity

    (base, opacity), (whole, _), (mouths, _) = of(0, 0), of(1, 0), of(0, 1)
    whole, mouths = whole - base, mouths - base
    return torch.stack([whole, mouths, opacity - whole - mouths, opacity], -1).cpu().numpy()


def with_colour(images: Tensor, value: float) -> Tensor:
    """Images (N, 4, h, w) of one grey value, with their mattes."""
    out = images.clone()
    out[:, :MATTE] = value
    return out


def composition(
    model: Path,
    clip: PreparedClip,
    speech: SpeechFrames,
    parts: Sequence[Part],
    learned: Sequence[Part],
    *,
    device: str = "auto",
    progress: Progress,
) -> dict[str, float]:
    """Measures `FRAMES` frames of a dub of the learned images with other speech.

    Args:
        model: a person's, of the method `dfrf`.
        clip: of the person; speech: the audio at its frames.
        parts: frames whose speech is spoken. learned: frames that were learned from.
        device: auto, cpu or cuda.

    Returns:
        `replaced NAME` and `mouth NAME`: shares of `SOURCES` in what is replaced and in the box of
        the mouth. `NAME changes dB`: PSNR of the mouth to itself after each of `CHANGES`.
        Empty for a method without references and mouth crops, or whose density is not baked.
    """
    person, maps, _ = heads.load(model, device)
    if not (isinstance(person, FastModel) and isinstance(maps, ReferenceMaps) and person.baked):
        return {}
    if maps.mouths is None:
        return {}
    some = _chosen(person, maps, clip, speech, parts, learned, progress)
    shares = _shares(some)
    progress("composition: shares", 0.3)
    found = {
        f"{place} {name}": value for place, row in shares.items() for name, value in row.items()
    }
    unchanged = {baked: _mouths(some, _as_it_is(baked)) for baked in (True, False)}
    for done, (name, change) in enumerate(CHANGES.items(), 1):
        baked = change(some.model, some.maps, some.inputs)[2].baked
        found[f"{name} changes dB"] = _psnr(unchanged[baked], _mouths(some, change))
        progress(f"composition: {name}", 0.3 + 0.7 * done / len(CHANGES))
    return found


def _chosen(
    person: FastModel,
    maps: ReferenceMaps,
    clip: PreparedClip,
    speech: SpeechFrames,
    parts: Sequence[Part],
    learned: Sequence[Part],
    progress: Progress,
) -> _Frames:
    """The middle of the longest part."""
    first, count = max(parts, key=lambda part: part[1])
    begin = first + max(0, count - FRAMES) // 2
    spoken = np.arange(begin, min(first + count, begin + FRAMES))
    under = frames_under(clip.valid, clip.segment, learned, len(spoken))
    posed = refined(person, maps, clip, np.unique(under), progress)
    index = np.zeros(len(clip), int)
    index[spoken] = under
    inputs = inputs_of(person, posed, speech, index, begin, begin + len(spoken))
    return _Frames(posed, under, person, maps, replace(inputs, baked=True))


def _as_it_is(baked: bool) -> Change:
    return lambda model, maps, inputs: (model, maps, replace(inputs, baked=baked))


def _shares(some: _Frames) -> dict[str, dict[str, float]]:
    """Shares of `SOURCES` in the replaced pixels, and in the box of the mouth."""
    sums = {place: np.zeros(len(SOURCES)) for place in ("replaced", "mouth")}
    own_heads = some.changed(_as_it_is(baked=True))
    for film, head, parts in zip(some.films(), own_heads, some.parts(), strict=True):
        _, mask, new = replacement(film, head)
        share = new.astype(np.float64) / 255
        film_and_plate = [1 - share, share * (1 - parts[..., 3])]
        pixels = np.stack([*(share * parts[..., k] for k in range(3)), *film_and_plate], -1)
        sums["replaced"] += pixels[mask > 0].sum(0)
        sums["mouth"] += pixels[_mouth(film)].reshape(-1, len(SOURCES)).sum(0)
    return {
        place: dict(zip(SOURCES, (row / row.sum()).tolist(), strict=True))
        for place, row in sums.items()
    }


def _mouth(film: FilmFrame) -> tuple[slice, slice]:
    ((left, top, right, bottom),) = mouth_boxes(film.landmarks[None], len(film.image))
    return slice(top, bottom), slice(left, right)


def _mouths(some: _Frames, change: Change) -> list[np.ndarray]:
    """Boxes of the mouth in the finished frames after a change."""
    return [
        blend(film.image, *replacement(film, head)[:2])[_mouth(film)].astype(np.float64)
        for film, head in zip(some.films(), some.changed(change), strict=True)
    ]


def _psnr(one: list[np.ndarray], other: list[np.ndarray]) -> float:
    squared = np.mean(
        np.concatenate([(a - b).ravel() ** 2 for a, b in zip(one, other, strict=True)])
    )
    return min(LIKE, float(10 * np.log10(255**2 / max(squared, 1e-9))))
