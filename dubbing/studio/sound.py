"""The sound of a dub for the page: a file that browsers play, and how loud it is."""

from pathlib import Path

import numpy as np
import soundfile

from dubbing import media
from dubbing.mixing.mix import mix
from dubbing.mixing.sound import SOUND
from dubbing.production.dub import Dub

RATE = 24000  # Hz
PEAKS = 100  # a second


def write_sound(dub: Dub, folder: Path) -> tuple[str, list[float]]:
    """Write FOLDER/NAME.flac, as the finished dub has it; gives its path and its peaks."""
    folder.mkdir(parents=True, exist_ok=True)
    own, seconds = folder / f"{dub.name}.flac", float(dub.length / dub.film.rate)
    if (cue := dub.sound.recording) is not None:
        source, start = cue.audio, cue.audio_start
        seconds = min(cue.seconds, seconds)
    else:
        mix(dub.sound, dub.film.path, folder)
        source, start = folder / SOUND, 0.0
    peaks: list[float] = []
    left = round(float(dub.length / dub.film.rate) * RATE)  # samples
    with soundfile.SoundFile(own, "w", RATE, 1, "PCM_16") as out:
        for block in media.iter_audio(source, rate=RATE, start=start, seconds=seconds):
            out.write(np.clip(block, -1, 1))
            left -= len(block)
            parts = np.array_split(np.abs(block), max(1, round(len(block) * PEAKS / RATE)))
            peaks += [round(float(part.max(initial=0)), 3) for part in parts]
        out.write(np.zeros(max(0, left), np.float32))
        peaks += [0.0] * (max(0, left) * PEAKS // RATE)
    return str(own), peaks
