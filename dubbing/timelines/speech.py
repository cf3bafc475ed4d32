"""The new speech of a cut: a recording along the cut, or recordings beside its films.

Of one along the cut every dub gets a file of its own, which stays as it is when the shot moves with
its speech.
"""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
import soundfile

from dubbing.engine.files import atomic_path
from dubbing.errors import ExplainedError
from dubbing.manifest.init import clip_of
from dubbing.timelines.films import Shot, stem_of
from dubbing.timelines.reading import Event
from dubbing.timelines.stretch import Stretch, number, seen_from

FOLDER = "manifest.speech"  # beside the manifest
SUFFIXES = (".wav", ".flac", ".aif", ".aiff")
NEAR = Fraction(1, 1000)  # s
ROUNDED = (0, -1, 1)  # samples by which a conformed recording may be off: a frame need not be whole


class Recordings:
    """Recordings by what they run along, which their names begin with; see `init.clip_of`.

    Args:
        folder: of the manifest.
    """

    def __init__(
        self, folder: Path, files: Iterable[Path], films: Iterable[Path], timeline: Path
    ) -> None:
        self._folder = folder
        sounds = [path for path in files if path.suffix.lower() in SUFFIXES]
        self._of: dict[str, Path] = {}
        stems = [*map(stem_of, films), timeline.stem]
        for path in sounds:
            stem = clip_of(path.stem, stems) or (timeline.stem if len(sounds) == 1 else "")
            if stem and self._of.setdefault(stem, path) != path:
                what = f"{self._of[stem].name} and {path.name} are both called as {stem}"
                raise ExplainedError(what, remedy="leave one of them there: a cut has one language")
        self._along = self._of.get(timeline.stem)
        self._like = timeline.stem

    def is_of(self, stretch: Stretch, shot: Shot, event: Event) -> bool:
        """Whether a dub has the speech of an event already."""
        if stretch.lines:
            return True
        entry, start = stretch.entry, stretch.first / stretch.rate
        own = (self._folder / str(entry.get("audio"))).resolve()
        if beside := self._of.get(stem_of(stretch.film)):
            return own == beside and abs(Fraction(entry.get("audio_start") or 0) - start) < NEAR
        if own.parent != self._folder / FOLDER or not own.is_file():
            return False
        length = (shot.stop - shot.first) / stretch.rate
        there = _samples(own, (shot.first - stretch.first) / stretch.rate, length)
        wanted = (_samples(self._recording, event.record, length, late) for late in ROUNDED)
        return any(np.array_equal(there, one) for one in wanted)

    def give(self, stretch: Stretch, shot: Shot, event: Event) -> None:
        """Give a dub the speech of an event."""
        entry, start = stretch.entry, stretch.first / stretch.rate
        entry.pop("audio_start", None)
        if beside := self._of.get(stem_of(stretch.film)):
            entry["audio"], entry["audio_start"] = seen_from(self._folder, beside), number(start)
            return
        target = self._folder / FOLDER / f"{entry['name']}.wav"
        length = (stretch.stop - stretch.first) / stretch.rate
        record = event.record - (shot.first - stretch.first) / stretch.rate
        with soundfile.SoundFile(self._recording) as sound, atomic_path(target) as temporary:
            samples = _samples(self._recording, record, length)
            soundfile.write(temporary, samples, sound.samplerate, sound.subtype, format="WAV")
        entry["audio"] = seen_from(self._folder, target)

    @property
    def _recording(self) -> Path:
        if self._along is None:
            remedy = f"put it there as {self._like}.wav, as long as the cut"
            raise ExplainedError("no recording of new speech", str(self._folder), remedy)
        return self._along


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
