"""Which frames of a person become references: sharp ones that stand for all others."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.data.dataset import EYES, HeadDataset
from dfrf.fast.medoids import medoids
from dfrf.metrics.image import crop, gradient_energy
from dubbing.face.mouth_shape import OUTER_LIP

UPPER_LIP, LOWER_LIP = 13, 14  # middle of the inner rim
MOST_COMPARED = 1000  # frames: more show little that is new
SOFT = 2 / 3  # share of the frames
# Turn (rad) from the nearest sharp frame beyond which a soft one is better than none.
ALONE = np.radians(6)
# Root mean square turn (rad) beyond which each frame looks at the references near to it. Below, the
# same ones for all frames serve other shots better: nothing changes with the pose.
FAR = np.radians(4)


def turns_far(person: HeadDataset) -> bool:
    """Whether a head is seen from sides so different that no few frames stand for all."""
    seen_from = F.normalize(person.c2w[:, :, 3], dim=-1)
    middle = F.normalize(seen_from.mean(0), dim=0)
    turns = torch.acos((seen_from @ middle).clamp(-1, 1))
    return bool(turns.square().mean().sqrt() > FAR)


def choose_references(person: HeadDataset, landmarks: np.ndarray, count: int) -> Tensor:
    """Sharp frames that stand for all poses and mouth shapes, (count,).

    What a reference does not show sharply no dub will, and motion, a codec or a lid half shut make
    frames soft: they are of the third whose eyes are sharpest, and of those that show the head from
    a side from which no sharp one does.

    Args:
        person: the frames to choose from.
        landmarks: (T, 478, 2) of those frames, pixels.
        count: how many.
    """
    forward = person.c2w[:, :, 2].double().numpy()
    lips = landmarks[:, OUTER_LIP]
    width = lips[:, :, 0].max(1) - lips[:, :, 0].min(1)
    gap = np.linalg.norm(landmarks[:, UPPER_LIP] - landmarks[:, LOWER_LIP], axis=-1)
    scale = np.median(width)
    traits = np.concatenate(
        [forward * 2, (gap / scale)[:, None] * 2, (width / scale)[:, None]], axis=1
    )
    some = np.unique(np.linspace(0, person.frames - 1, MOST_COMPARED).round().astype(int))
    sharp = eye_sharpness(person, some)
    is_sharp = sharp >= np.quantile(sharp, SOFT)
    turn = np.linalg.norm(forward[some, None] - forward[some[is_sharp]], axis=-1).min(1)
    may = some[is_sharp | (turn > ALONE)]
    apart = ((traits[some, None] - traits[may]) ** 2).sum(-1)
    return torch.from_numpy(may[medoids(apart, count)])


def eye_sharpness(person: HeadDataset, frames: np.ndarray) -> np.ndarray:
    """Gradient energy of the luminance round the eyes of frames (F,); 0 where none is seen."""
    energy = np.zeros(len(frames))
    for n, t in enumerate(frames):
        rows, columns = torch.nonzero(person.regions[t] == EYES).unbind(1)
        if rows.numel() and rows.min() < rows.max() and columns.min() < columns.max():
            box = torch.stack([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
            energy[n] = gradient_energy(crop(person.images[t].float() / 255, box))
    return energy
