"""The lips that are heard in a line, as the page draws them."""

from __future__ import annotations

from typing import Any

import numpy as np

from dfrf.field.speaker_adaptation import OPENING, WIDTH
from dubbing.heads.rendering import wanted_lips
from dubbing.identity.learned import learned
from dubbing.identity.lip_scale import LipScale
from dubbing.script.timeline import Cue
from dubbing.stages.composite import PersonOnFilm
from dubbing.stages.draft import HalfSize

DRAWN = {"opening": OPENING, "width": WIDTH}


def heard_lips(half: HalfSize, person: PersonOnFilm, cue: Cue) -> dict[str, Any]:
    """Opening and width in the frames of a cue, as heard, and of a closed mouth: eye distances.

    Empty where the person's model has no lip measures.
    """
    speech, (model, _) = half.speech[cue.name], half.models[cue.identity]
    frames = min(cue.stop, len(half.poses)) - cue.first
    part = speech.part(0, frames)
    heard = wanted_lips(model, part)
    closed = wanted_lips(model, part.part(0, 1), np.zeros(1, np.float32))
    if heard is None or closed is None:
        return {}
    parts = zip(person.learned, learned(person.model.folder), strict=True)
    scale = LipScale.of([(clip.load(), [*some, *turned]) for clip, (_, some, turned) in parts])
    lengths, shut = scale.lengths(heard), scale.lengths(closed)[0]
    return {
        name: {"heard": lengths[:, k].round(4).tolist(), "closed": round(float(shut[k]), 4)}
        for name, k in DRAWN.items()
    }
