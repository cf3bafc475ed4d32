"""Views of the film that is dubbed: it shows the person in its own light, poses and lens.

Beside the views that a person was learned from, a head reads views of the film itself: whole ones
from viewpoints that were not learned, and crops round the mouth. They have other lips than are
wanted, and are moved like all others. Nothing is learned from them. N views, P crops.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.data.dataset import HeadDataset
from dfrf.data.reference_cuts import cut_mouths_like, cut_references_like
from dfrf.fast.medoids import medoids
from dfrf.field.audio import WINDOW
from dfrf.field.mouth_pixels import MOUTHS, TURN, lip_traits
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.reference_views import ReferenceViews
from dfrf.field.speaker_adaptation import NUMBERS
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dubbing.identity.clip_frames import ClipFrames
from dubbing.identity.dataset import load_identity
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames

VIEWS_FILE = "views.safetensors"
MOST = 200  # frames that are looked at
WHOLE = 8  # views of the whole head at most
NEW = np.radians(8)  # turn from the nearest learned view from which on a view is new
FEWEST = 10  # frames of a film that are worth it


def views_of_film(
    model: HeadModel,
    maps: ReferenceMaps,
    clip: PreparedClip,
    known: np.ndarray,
    folder: Path,
) -> ReferenceViews | None:
    """Views of a film, or None where it shows little that was not learned.

    Args:
        model: of the person. maps: of the views it was learned from.
        clip: the film, with refined poses.
        known: (T,) bool, frames that were learned from.
        folder: for the images while they are looked at.
    """
    learned = maps.views
    frames = np.flatnonzero(clip.detected & ~clip.covered & ~clip.over & ~known)
    if len(frames) < FEWEST or learned.mouths is None:
        return None
    frames = frames[np.unique(np.linspace(0, len(frames) - 1, MOST).round().astype(int))]
    silence = SpeechFrames(
        np.zeros((len(clip), WINDOW, method_of(model).speech_dim), np.float32),
        np.zeros((len(clip), NUMBERS), np.float32),
    )
    footage = [ClipFrames(clip, silence, frames)]
    film = load_identity(clip.clip.stem, footage, folder=folder, focal=learned.focal)
    whole = new_viewpoints(film.c2w, learned.c2w)
    views = cut_references_like(film, whole, learned)
    views = replace(views, mouths=cut_mouths_like(film, mouths_of(film), learned.mouths))
    return method_of(model).with_surfaces(film, views, whole, maps)


def new_viewpoints(film: Float[Tensor, "T 3 4"], learned: Float[Tensor, "N 3 4"]) -> Tensor:
    """Frames of a film, at most `WHOLE`, that are seen from where no learned view is seen from."""
    at, known = (F.normalize(x[:, :, 3], dim=-1) for x in (film, learned))
    turn = torch.acos((at @ known.T).clamp(-1, 1)).amin(1)
    chosen: list[int] = []
    while len(chosen) < WHOLE and float(turn.max()) > NEW:
        chosen.append(int(turn.argmax()))
        turn = torch.minimum(turn, torch.acos((at @ at[chosen[-1]]).clamp(-1, 1)))
    return torch.tensor(sorted(chosen), dtype=torch.long)


def mouths_of(film: HeadDataset) -> Tensor:
    """Frames that represent all lips and poses of a film."""
    viewpoint = F.normalize(film.c2w[:, :, 3], dim=-1)
    traits = torch.cat([lip_traits(film.lip_points, film.lip_points), viewpoint / TURN], 1).double()
    distance = torch.cdist(traits, traits).square().numpy()
    return torch.tensor(sorted(medoids(distance, min(MOUTHS, film.frames))))


def joined(learned: ReferenceViews, film: ReferenceViews) -> ReferenceViews:
    """Learned views and those of a film as one set."""
    assert learned.mouths is not None
    assert film.mouths is not None
    whole = _together(learned, film)
    ours, theirs = learned.mouths, film.mouths
    frames = torch.arange(len(ours.frames) + len(theirs.frames))
    mouths = replace(
        ours,
        views=_together(ours.views, theirs.views),
        lips=torch.cat([ours.lips, theirs.lips]),
        frames=frames,
    )
    return replace(whole, mouths=mouths)


def _together(a: ReferenceViews, b: ReferenceViews) -> ReferenceViews:
    surface = None
    if a.surface is not None and b.surface is not None:
        surface = torch.cat([a.surface, b.surface])
    return replace(
        a,
        images=torch.cat([a.images, b.images]),
        mattes=torch.cat([a.mattes, b.mattes]),
        c2w=torch.cat([a.c2w, b.c2w]),
        centres=torch.cat([a.centres, b.centres]),
        surface=surface,
    )
