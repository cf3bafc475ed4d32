"""Chooses the reference frames of a person: sharp ones that represent all others."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.data.dataset import EYES, HeadDataset
from dfrf.fast.medoids import medoids
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.identity.sharpness import gradient_energy

UPPER_LIP, LOWER_LIP = 13, 14  # middle of the inner rim
MOST_COMPARED = 1000  # frames: more add little
SOFT = 2 / 3  # share of the frames
# Turn (rad) from the nearest sharp frame beyond which a soft one is better than none.
MAX_TURN = np.radians(6)
# Root mean square turn (rad) beyond which each frame uses the references nearest to it. Below, the
# same references for all frames are better on other shots: nothing changes with the pose.
FAR = np.radians(4)


def turns_far(person: HeadDataset) -> bool:
    """Whether viewpoints differ so much that a few frames cannot represent all."""
    viewpoints = F.normalize(person.c2w[:, :, 3], dim=-1)
    middle = F.normalize(viewpoints.mean(0), dim=0)
    turns = torch.acos((viewpoints @ middle).clamp(-1, 1))
    return bool(turns.square().mean().sqrt() > FAR)


def choose_references(person: HeadDataset, landmarks: np.ndarray, count: int) -> Tensor:
    """Sharp frames that represent all poses and mouth shapes, (count,).

    A dub is no sharper than its references, and motion, a codec or a half-closed lid make frames
    soft. So candidates are the third of the frames whose eyes are sharpest, and frames from
    viewpoints that no sharp frame has.

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
    candidates = some[is_sharp | (turn > MAX_TURN)]
    distance = ((traits[some, None] - traits[candidates]) ** 2).sum(-1)
    return torch.from_numpy(candidates[medoids(distance, count)])


def eye_sharpness(person: HeadDataset, frames: np.ndarray) -> np.ndarray:
    """Gradient energy of the luminance round the eyes of frames (F,); 0 without eyes."""
    energy = np.zeros(len(frames))
    for n, t in enumerate(frames):
        eyes = person.regions[t].numpy() == EYES
        rows, columns = (np.flatnonzero(eyes.any(axis)) for axis in (1, 0))
        if len(rows) > 1 and len(columns) > 1:
            box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            energy[n] = gradient_energy(person.images[t][box].float() / 255)
    return energy
