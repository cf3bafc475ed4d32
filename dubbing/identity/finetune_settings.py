"""Settings of a person's fine-tune, from the manifest to the model's header. Loads no torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dfrf.config import STEPS, family
from dubbing.engine.graph.fields import Setting
from dubbing.speech import features

# That a dub needs of a person who looks into the camera, and of one who turns.
FRONT_STEPS, TURNED_STEPS = 60, 250


@dataclass(frozen=True)
class FinetuneSettings:
    """Settings of a fine-tune.

    Attributes:
        preset: name in `dfrf.presets`.
        iterations: optimiser steps; None for as many as a dub needs, see `steps`.
        seed: of rays and, without a base, of the weights.
        speech: name of the speech features.
        speech_weights: weights of the user's own for them, a path. What reads them declares the
            files behind it.
        references: so many in every frame, the same ones, instead of the preset's.
        warp: False leaves equations (3) and (4) out.
        turned: learns beside its seconds from frames in which the head is turned further; see
            `dubbing.identity.clip_frames`.
        learning_rate: Adam's first, rays: of a step; None as the preset has them.
    """

    preset: str = "fast"
    iterations: int | None = None
    seed: int = 0
    speech: str = "rnn"
    speech_weights: Setting[str | None] = None
    references: int | None = None
    warp: bool = True
    turned: bool = True
    learning_rate: float | None = None
    rays: int | None = None

    def steps(self, *, from_base: bool, turned: bool = False) -> int:
        """Optimiser steps.

        The mouth of a dub comes from crops of the film, so it is no better after more steps than
        these. Chin and far cheek of a turned head need more; hair and skin, which a dub takes from
        the film, go on to gain.

        Args:
            from_base: whether it starts from a base.
            turned: whether the views differ much; see `reference_choice.turns_far`.
        """
        if self.iterations is not None:
            return self.iterations
        if family(self.preset) != "fast" or not from_base:
            return STEPS[family(self.preset)]
        return TURNED_STEPS if turned else FRONT_STEPS

    @property
    def weights(self) -> Path | None:
        """The weights of the user's own for the speech features."""
        return None if self.speech_weights is None else Path(self.speech_weights)

    def speech_header(self) -> dict[str, str]:
        """Entries of a checkpoint's header about speech features: name, and digest of weights."""
        digest = features.fingerprint(self.speech, self.weights)
        return {"speech": self.speech, **({"speech_digest": digest} if digest else {})}
