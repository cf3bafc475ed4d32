"""Made-up people: noise for what is heard, and lips that follow some of it."""

from __future__ import annotations

import numpy as np
import torch

from dubbing.sound_to_lips.encoder import CHANNELS, STEP
from dubbing.speech.voice_activity import SAMPLE_RATE
from dubbing.workshop.training.lips.lip_clips import LipClip, Take

FRAMES, RATE = 150, 25
LATE = 2  # steps that lips come after what is heard


def lip_clip(seed: int, frames: int = FRAMES) -> LipClip:
    """A person whose lips follow seven channels, 48 ms late, and touch where one is low."""
    rng = np.random.default_rng(seed)
    times = (np.arange(frames) + 0.5) / RATE
    place = times * SAMPLE_RATE / STEP - 0.5 - LATE
    steps = int(place[-1]) + LATE + 2
    noise = rng.standard_normal((steps + 8, CHANNELS))
    noise[:, 12:] *= 0.05  # few channels say anything
    heard = np.stack([noise[k : k + 9].mean(0) * 3 for k in range(steps)])
    index = np.clip(np.round(place).astype(int), 0, steps - 1)
    lips = heard[index, :7] / heard[:, :7].std(0)
    return LipClip(
        name=f"made {seed}",
        times=times,
        lips=lips + rng.standard_normal((frames, 7)) * 0.2,
        closed=(lips[:, 0] < -0.8).astype(float),
        takes=(Take(1.0, torch.from_numpy(heard).half()),),
    )
