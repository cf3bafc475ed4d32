"""Figures of a dub that has a true picture.

T frames of side S: of the dub, of the film that was dubbed (what A says), and of the true dub (what
B says). They differ in the face alone. Ratios are of the dub to the true dub; their aim is 1.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import cv2
import numpy as np
import torch

from dubbing.face.finding.landmarks import FaceMesh
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.sync.network.sync_network import load_network
from dubbing.workshop.lab.chin import CHIN_LINE, HALF_BAND, distance_to_line, gradient_energies
from dubbing.workshop.lab.measuring import first_of
from dubbing.workshop.lab.metrics import image as metrics
from dubbing.workshop.lab.mouth import MouthSeries

DIFFERENT = 3  # grey levels: less is no other picture
LEAST = 0.02  # of the mouth's box that must be replaced where a frame counts as dubbed
COVERING = 0.1  # of the mouth's box: then something covers it
OPAQUE = 0.98
CHANGED = 8  # grey levels: a pixel of what is in front was changed
APART = 2  # half bands between the chins of A and B
NOISY = 1.2  # grey levels of noise in the true dub; with less, its ratio says nothing
EDGE = 2  # px to each side of the edge of what is replaced
FINE = 1.0  # px, Gaussian: detail below it is noise
NOT_KNOWN = float("nan")


class DubFigures:
    """Adds up the frames of one dub."""

    def __init__(self, rate: float) -> None:
        self._mouths = MouthSeries(load_network().face.numpy(), rate)
        self._meshes = [FaceMesh(tracking=True) for _ in range(3)]
        # Of the frames so far: values, and sums of the dub beside those of the true dub.
        self._lists: dict[str, list[float]] = defaultdict(list)
        self._sums: dict[str, np.ndarray] = defaultdict(lambda: np.zeros(2))
        self._noise: list[np.ndarray | None] = [None, None]
        self._count = 0

    def add(
        self,
        dub: np.ndarray,
        film: np.ndarray,
        truth: np.ndarray,
        mouth: np.ndarray,
        cover: np.ndarray | None,
    ) -> None:
        """One frame.

        Args:
            dub, film, truth: (S, S, 3) uint8.
            mouth: (2, 2) px, middle of the mouth and half its width and height.
            cover: (S, S) in 0..1, opacity of what is in front; None where nothing is.
        """
        box = extent(mouth, len(dub))
        replaced = differs(dub, film, 0)
        dubbed = replaced[box].mean() > LEAST
        self._lists["dubbed"].append(float(dubbed))
        if cover is not None:
            hidden = cover[box].mean() > COVERING
            if hidden:
                self._lists["covered_dubbed"].append(float(dubbed))
            solid = cover > OPAQUE
            if solid.any():
                changed = differs(dub, film, CHANGED)[solid].sum()
                self._sums["cover_changed"] += [changed, solid.sum()]
        region = replaced | differs(film, truth, DIFFERENT)
        self._lists["psnr"].append(psnr(dub, truth, region))
        inside = np.zeros_like(region)
        inside[box] = True
        self._lists["psnr_mouth"].append(psnr(dub, truth, inside))
        pair = [
            torch.from_numpy(np.ascontiguousarray(x[grown(box, 8)])).float() / 255
            for x in (dub, truth)
        ]
        self._lists["ssim_mouth"].append(metrics.ssim(*pair))
        self._seam(dub, truth, replaced)
        self._detail(dub, truth, region & ~inside)
        meshes = [
            first_of(mesh(x)) for mesh, x in zip(self._meshes, (dub, film, truth), strict=True)
        ]
        self._mouths.add(self._count, dub, truth, meshes[0], meshes[2])
        if meshes[1] is not None and meshes[2] is not None:
            self._chin(dub, truth, meshes[1][:, :2], meshes[2][:, :2])
        self._count += 1

    def _seam(self, dub: np.ndarray, truth: np.ndarray, replaced: np.ndarray) -> None:
        """Gradient energy along the edge of what is replaced."""
        whole = cv2.morphologyEx(replaced.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5)))
        kernel = np.ones((2 * EDGE + 1,) * 2)
        band = (cv2.dilate(whole, kernel) > 0) & (cv2.erode(whole, kernel) == 0)
        self._sums["seam"] += [gradient_energies(x)[band].sum() for x in (dub, truth)]

    def _detail(self, dub: np.ndarray, truth: np.ndarray, region: np.ndarray) -> None:
        """Noise and sharpness of the replaced skin beside the mouth."""
        if region.sum() < 50:
            self._noise = [None, None]
            return
        noise, sharp = [], []
        for k, image in enumerate((dub, truth)):
            grey = image.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32)
            smooth = cv2.GaussianBlur(grey, (0, 0), FINE)
            before, self._noise[k] = self._noise[k], grey - smooth
            if before is not None:
                changed = np.abs(self._noise[k] - before)
                noise.append(deviation(changed[region]))
                beside = deviation(changed[~region])
            sharp.append(gradient_energies(np.repeat(smooth[..., None], 3, 2))[region].sum())
        self._sums["sharpness"] += sharp
        if noise:
            self._sums["noise"] += noise
            # Skin that moves changes, too, but what is beside it only by noise.
            self._lists["true_noise"].append(beside)

    def _chin(
        self, dub: np.ndarray, truth: np.ndarray, film_points: np.ndarray, points: np.ndarray
    ) -> None:
        """Gradient energy along the true chin, and where the film's chin was."""
        eyes = float(np.linalg.norm(points[LEFT_EYE_OUTER] - points[RIGHT_EYE_OUTER]))
        half = max(1.0, HALF_BAND * eyes)
        new, old = (distance_to_line(p[list(CHIN_LINE)], len(dub)) for p in (points, film_points))
        energies = [gradient_energies(x) for x in (dub, truth)]
        self._sums["chin"] += [e[new <= half].sum() for e in energies]
        beside = (old <= half) & (new > APART * half)
        self._sums["old_chin"] += [e[beside].sum() for e in energies]

    def figures(self) -> dict[str, float]:
        """Figures of all frames; one that cannot be computed is left out."""
        found = {name: float(np.nanmean(values)) for name, values in self._lists.items()}
        noisy = found.pop("true_noise", 0.0) > NOISY
        for name in ("seam", "chin", "old_chin", "sharpness", "cover_changed", *["noise"] * noisy):
            dub, truth = self._sums[name]
            if truth > 0:
                found[name] = float(dub / truth)
        found |= self._mouths.figures()
        return {name: value for name, value in found.items() if not np.isnan(value)}


def deviation(changes: np.ndarray) -> float:
    """Standard deviation of the noise in one frame, of differences between two; robust."""
    return 1.4826 * float(np.median(changes)) / float(np.sqrt(2))


def differs(image: np.ndarray, other: np.ndarray, levels: int) -> np.ndarray:
    """Pixels (S, S) bool of which a channel differs by more than so many grey levels."""
    return np.asarray((np.abs(image.astype(np.int16) - other) > levels).any(-1))


def psnr(image: np.ndarray, truth: np.ndarray, where: np.ndarray) -> float:
    """PSNR in dB over some pixels; not a number where there are none."""
    if not where.any():
        return NOT_KNOWN
    error = float(np.square(image[where].astype(np.float32) - truth[where]).mean())
    return float(10 * np.log10(255**2 / max(error, 1e-2)))


def extent(mouth: np.ndarray, size: int) -> tuple[slice, slice]:
    """Rows and columns of the mouth's box."""
    low = np.clip(np.floor(mouth[0] - mouth[1]), 0, size - 1).astype(int)
    high = np.clip(np.ceil(mouth[0] + mouth[1]), low + 1, size).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def grown(box: tuple[slice, slice], by: int) -> tuple[slice, slice]:
    """A box with so many px round it."""
    rows, columns = (slice(max(0, x.start - by), x.stop + by) for x in box)
    return rows, columns


def mean_of(figures: Iterable[dict[str, float]]) -> dict[str, float]:
    """Mean of every figure over the scenes that have it."""
    every: dict[str, list[float]] = defaultdict(list)
    for one in figures:
        for name, value in one.items():
            every[name].append(value)
    return {name: float(np.mean(values)) for name, values in every.items()}
