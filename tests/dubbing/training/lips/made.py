"""Made-up people: noise for what is heard, and lips that follow some of it."""

from __future__ import annotations

import numpy as np
import torch

from dubbing.sound_to_lips.network import HIDDEN, OUTLINE, SENONES, LipNetwork, Sizes
from dubbing.speech.voice_activity import STEP_RATE
from dubbing.training.lips.lessons import Lesson, Take

FRAMES, RATE = 150, 25
TINY = Sizes(hidden_taps=1, senone_taps=1, members=1, width=16, dilations=(1, 2), dropout=0.1)


def lesson(seed: int, frames: int = FRAMES) -> Lesson:
    """A person whose lips follow seven hidden values, 80 ms late, and touch where one is low."""
    rng = np.random.default_rng(seed)
    steps = frames * STEP_RATE // RATE
    noise = rng.standard_normal((steps + 8, HIDDEN + SENONES))
    noise[:, 12:] *= 0.05  # few values say anything
    activations = np.stack([noise[k : k + 9].mean(0) * 3 for k in range(steps)]) * 0.5
    times = (np.arange(frames) + 0.5) / RATE
    index = np.clip(np.round(times * STEP_RATE - 0.5 - 4).astype(int), 0, steps - 1)
    lips = activations[index, :7] / activations[:, :7].std(0)
    own = rng.standard_normal((frames, 7)) * 0.2
    return Lesson(
        name=f"made {seed}",
        times=times,
        lips=lips + own,
        closed=(lips[:, 0] < -0.8).astype(float),
        outline=rng.standard_normal((frames, OUTLINE)),
        takes=(
            Take(1.0, torch.from_numpy(activations).half(), torch.ones(steps, dtype=torch.float16)),
        ),
    )


def network(sizes: Sizes = TINY) -> LipNetwork:
    """With features that are the first 64 outputs."""
    torch.manual_seed(0)
    return LipNetwork(torch.eye(64, HIDDEN + SENONES), torch.zeros(64), sizes)
