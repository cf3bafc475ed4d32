"""The new speech of a cut: a recording along it, of which every dub gets a file of its own.

That file stays as it is when the shot moves with its speech.
"""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
import soundfile

from dubbing.engine.disk.files import atomic_path, seen_from
from dubbing.errors import ExplainedError
from dubbing.manifest.init import clip_of
from dubbing.timelines.films import Shot
from dubbing.timelines.reading import Event
from dubbing.timelines.stretch import Stretch

FOLDER = "manifest.speech"  # beside the manifest
SUFFIXES = (".wav", ".flac", ".aif", ".aiff")
ROUNDED = (0, -1, 1)  # samples by which a conformed recording may be off: a frame need not be whole


class Speech:
    """The recording along a cut, which is called as the timeline, or alone in the folder.

    Args:
        folder: of the manifest.

    Attributes:
        recording: its file.

    Raises:
        ExplainedError: there is none, or there are several.
    """

    def __init__(self, folder: Path, files: Iterable[Path], timeline: Path) -> None:
        sounds = [path for path in files if path.suffix.lower() in SUFFIXES]
        named = [path for path in sounds if clip_of(path.stem, [timeline.stem])] or sounds
        if len(named) != 1:
            there = f": {' and '.join(path.name for path in named)}" if named else ""
            remedy = f"put one there, {timeline.stem}.wav, as long as the cut"
            what = f"{len(named)} recordings of new speech{there}"
            raise ExplainedError(what, str(folder), remedy)
        self._folder, self.recording = folder, named[0]

    def is_of(self, stretch: Stretch, shot: Shot, event: Event) -> bool:
        """Whether a dub has the speech of an event already."""
        if stretch.lines:
            return True
        own = (self._folder / str(stretch.entry.get("audio"))).resolve()
        if own.parent != self._folder / FOLDER or not own.is_file():
            return False
        length = (shot.stop - shot.first) / stretch.rate
        there = _samples(own, (shot.first - stretch.first) / stretch.rate, length)
        wanted = (_samples(self.recording, event.record, length, late) for late in ROUNDED)
        return any(np.array_equal(there, one) for one in wanted)

    def give(self, stretch: Stretch, shot: Shot, event: Event) -> None:
        """Give a dub the speech of an event."""
        target = self._folder / FOLDER / f"{stretch.name}.wav"
        length = (stretch.stop - stretch.first) / stretch.rate
        record = event.record - (shot.first - stretch.first) / stretch.rate
        with soundfile.SoundFile(self.recording) as sound, atomic_path(target) as temporary:
            samples = _samples(self.recording, record, length)
            soundfile.write(temporary, samples, sound.samplerate, sound.subtype, format="WAV")
        stretch.entry["audio"] = seen_from(self._folder, target)
        stretch.entry.pop("audio_start", None)


def _samples(path: Path, start: Fraction, length: Fraction, late: int = 0) -> np.ndarray:
    """Samples (N, channels) int32 of seconds of a recording; silence before and after it."""
    try:
        with soundfile.SoundFile(path) as sound:
            first, count = round(start * sound.samplerate) + late, round(length * sound.samplerate)
            samples = np.zeros((count, sound.channels), np.int32)
            begin, end = (min(max(at, 0), sound.frames) for at in (first, first + count))
            sound.seek(begin)
            samples[begin - first : end - first] = sound.read(end - begin, "int32", always_2d=True)
    except soundfile.LibsndfileError as error:
        raise ExplainedError(f"cannot be read: {error.error_string}", str(path)) from error
    return samples
