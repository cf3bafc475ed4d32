"""The mouths of a render and of its source, frame by frame, in the face's own frame.

Every mesh is laid over one canonical face by the points that speech does not move
(`dubbing.face.mouth.mouth_shape`), so pose, place and size of the head fall out, and a render may
be compared with a source that looks elsewhere.

S side of the crop in px, L = 40 lip points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from dfrf.training.warp_penalty import PAPER_SIZE
from dubbing.face.mouth.mouth_shape import INNER_LIP, OUTER_LIP, RIGID, mouth_shape, opening, width
from dubbing.face.mouth.similarity import similarity
from dubbing.identity.dataset import mouth_boxes
from dubbing.identity.sharpness import gradient_energy
from dubbing.workshop.lab.metrics import image as metrics
from dubbing.workshop.lab.metrics import lips

LIPS = len(OUTER_LIP) + len(INNER_LIP)  # the first points of a mouth shape
NOT_KNOWN = float("nan")


@dataclass(frozen=True)
class MouthFigures:
    """One frame: opening and width in eye distances, LMD and lip rms in px at 512, and the gradient
    energy of the box round the lips; those of the source beside them. Not a number where no face
    was found."""

    opening: float = NOT_KNOWN
    source_opening: float = NOT_KNOWN
    width: float = NOT_KNOWN
    source_width: float = NOT_KNOWN
    lmd: float = NOT_KNOWN
    lip_rms: float = NOT_KNOWN
    texture: float = NOT_KNOWN
    source_texture: float = NOT_KNOWN


class MouthSeries:
    """Adds up the mouths of the frames of a clip."""

    def __init__(self, face: np.ndarray, rate: float) -> None:
        """face: canonical `RIGID` points (K, 3). rate: frames a second."""
        self._face = face
        self._rate = rate
        self._frames: list[int] = []
        self._figures: list[MouthFigures] = []
        self._still: list[np.ndarray] = []  # (L, 2) px at 512, lips of the source
        self._missed = 0

    def add(
        self,
        frame: int,
        rendered: np.ndarray,
        image: np.ndarray,
        rendered_mesh: np.ndarray | None,
        true_mesh: np.ndarray | None,
    ) -> MouthFigures:
        """The figures of one frame, which are kept.

        Args:
            frame: its number in the clip; frames in a row have numbers in a row.
            rendered, image: render and source, (S, S, 3) uint8.
            rendered_mesh, true_mesh: their meshes (478, 3) px; None where no face was found.
        """
        figures = MouthFigures()
        if rendered_mesh is None and true_mesh is not None:
            self._missed += 1
        if rendered_mesh is not None and true_mesh is not None:
            pair = np.stack([rendered_mesh, true_mesh])
            shapes = mouth_shape(pair, self._face)
            both = shapes[:, :LIPS]
            unit = unit_of(true_mesh, self._face) * PAPER_SIZE / len(image)
            gap, wide = opening(shapes), width(shapes)
            self._still.append(both[1] * unit)
            figures = MouthFigures(
                *(float(gap[0]), float(gap[1]), float(wide[0]), float(wide[1])),
                lmd=float(lips.distances(both[:1], both[1:])[0] * unit),
                lip_rms=lips.rms(lips.squared_distances(both[:1], both[1:])) * unit,
                texture=texture(rendered, rendered_mesh),
                source_texture=texture(image, true_mesh),
            )
        self._frames.append(frame)
        self._figures.append(figures)
        return figures

    def series(self, name: str) -> np.ndarray:
        """One figure at every frame from the first to the last, NaN where it is not known."""
        if not self._frames:
            return np.zeros(0)
        first = min(self._frames)
        values = np.full(max(self._frames) - first + 1, np.nan)
        for frame, figures in zip(self._frames, self._figures, strict=True):
            values[frame - first] = getattr(figures, name)
        return values

    def figures(self, *, in_a_row: bool = True) -> dict[str, float]:
        """Figures of all frames; one that cannot be computed is left out.

        `missed` is there where a face is: frames in which only the source shows one. They are in no
        other figure.

        Args:
            in_a_row: whether the frames follow one another, but for cuts and for frames without a
                face. If not, how the mouth moves is not measured.
        """
        gap, true_gap = self.series("opening"), self.series("source_opening")
        wide, true_wide = self.series("width"), self.series("source_width")
        lmd = self.series("lmd")
        known = {
            "lmd": float(np.nanmean(lmd)) if np.isfinite(lmd).any() else NOT_KNOWN,
            "lip_rms": lips.rms(self.series("lip_rms") ** 2),
            "lip_rms_still": self._rms_of_a_still_mouth(),
            "texture_ratio": lips.energy_ratio(
                self.series("texture"), self.series("source_texture")
            ),
        }
        if in_a_row:
            known |= {
                "opening_r": lips.correlation(gap, true_gap),
                "width_r": lips.correlation(wide, true_wide),
                "closure_f1": lips.closure_f1(gap, true_gap),
                "closure_f1_near": lips.closure_f1(gap, true_gap, tolerance=1),
                "closure_mcc": lips.closure_mcc(gap, true_gap),
                "opening_ratio": lips.spread_ratio(gap, true_gap),
                "lag_ms": lips.lag_ms(gap, true_gap, self._rate),
            }
        figures = {name: value for name, value in known.items() if not np.isnan(value)}
        return figures | ({"missed": self._missed} if self._still or self._missed else {})

    def _rms_of_a_still_mouth(self) -> float:
        """`lip_rms` of a render whose lips would stay at the source's mean."""
        if not self._still:
            return NOT_KNOWN
        points = np.stack(self._still)
        return lips.rms(lips.squared_distances(points.mean(0), points))


def unit_of(mesh: np.ndarray, face: np.ndarray) -> float:
    """Pixels of a mesh (478, 3) that are one eye distance of the canonical face."""
    rigid = mesh[None, list(RIGID)].astype(np.float64)
    return float(1 / similarity(rigid, face.astype(np.float64)).scale[0])


def texture(image: np.ndarray, mesh: np.ndarray) -> float:
    """Gradient energy of an image (S, S, 3) uint8 in the box round the lips of its own mesh."""
    box = mouth_boxes(mesh[None, :, :2], len(image))[0]
    part = metrics.crop(torch.from_numpy(image), torch.from_numpy(box)).float() / 255
    return gradient_energy(part) if min(part.shape[:2]) > 1 else NOT_KNOWN
