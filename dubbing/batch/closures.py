"""Keys that shut the mouth on p, b and m of the words of lines, put into files of edits."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from dubbing import media
from dubbing.batch.curves import opened
from dubbing.batch.jobs import chosen_dubs
from dubbing.errors import ExplainedError
from dubbing.manifest.edits.kept_edits import KeptEdits
from dubbing.manifest.keys import edit_entry
from dubbing.production.production import Production
from dubbing.script.edit import AROUND, HELD, Edit
from dubbing.script.timeline import Cue
from dubbing.speech import voice_activity as voice
from dubbing.stages.draft import HalfSize

PARTED = 0.02  # eye distances beyond a closed mouth's, from which on lips do not touch
OPENED = 3 * HELD  # s between two closures, from which on the mouth opens between them
ROUNDED = 2  # digits of seconds


def closures_of(cue: Cue, half: HalfSize) -> list[float]:
    """Seconds of a cue's sound at which the lips should close, by its words, and do not."""
    import numpy as np

    from dubbing.speech.labials import labials

    found = labials(sound_of(cue), cue.words)
    heard = half.lips(cue, cue.edit)
    if heard is None:
        return [min(one.at, cue.seconds) for one in found]
    closed = half.lips(cue, Edit(), np.zeros(len(heard), np.float32))
    assert closed is not None
    open_ = heard[:, 0] > closed[0, 0] + PARTED
    needed = [one.at for one in found if open_[_beside(one.at, cue, len(open_))].all()]
    return [min(at, cue.seconds) for at in needed]


def sound_of(cue: Cue) -> voice.Blocks:
    """Gives the sound of a cue in blocks."""
    rate, start, seconds = voice.SAMPLE_RATE, cue.audio_start, cue.seconds
    return media.sound_blocks(cue.audio, rate=rate, start=start, seconds=seconds)


def _beside(at: float, cue: Cue, frames: int) -> slice:
    """The frame of a moment of a cue, and those beside it."""
    frame = min(int(at / cue.seconds * (cue.stop - cue.first)), frames - 1)
    return slice(max(0, frame - 1), frame + 2)


def with_closures(
    keys: Sequence[tuple[float, float]], at: Iterable[float], strength: float
) -> list[tuple[float, float]]:
    """Keys, moments and strengths, with a closure at moments that have no key nearby.

    Where the next closure is so near that the mouth would stay shut, but a mouth has time to open,
    a key opens it halfway between them.

    Args:
        strength: of the line.
    """
    new = [(round(one, ROUNDED), 0.0) for one in at if all(abs(one - k) >= AROUND for k, _ in keys)]
    every = sorted({*keys, *new})
    for (before, first), (after, last) in pairwise([*every]):
        if first == last == 0 and OPENED <= after - before <= 2 * AROUND:
            every.append((round((before + after) / 2, ROUNDED), strength))
    return sorted(every)


def write_closures(production: Production, only: tuple[str, ...] = ()) -> Iterator[str]:
    """Put closures into the edits of lines whose words are known; says what is done, a line each.

    A line with takes gets them in the one that is chosen.

    Raises:
        ExplainedError: a person is not learned, the edits of a dub cannot be read or written, or
            nobody knows any words.
    """
    if not any(cue.words for dub in chosen_dubs(production, only) for cue in dub.cues):
        what = "the words of no line are known"
        raise ExplainedError(what, str(production.manifest), "give a script in `lines`")
    for dub, half in opened(production, only):
        kept = KeptEdits(production.manifest, dub)
        _, entries = kept.entries()
        changed = {}
        for cue in (cue for cue in dub.cues if cue.words):
            own = with_closures(cue.edit.keys, found := closures_of(cue, half), cue.edit.strength)
            changed[cue] = _with_keys(entries.get(cue, kept.plain(cue)), own)
            yield f"{dub.name}, line {cue.number}: {len(found)} closures"
        kept.put({**entries, **changed}, changed)


def _with_keys(entry: edit_entry.Edit, keys: Sequence[tuple[float, float]]) -> edit_entry.Edit:
    """An entry whose take that is chosen has these keys."""
    own = [edit_entry.Key(at=at, strength=strength) for at, strength in keys]
    if not entry.take:
        return entry.model_copy(update={"keys": own})
    take = entry.takes[entry.take].model_copy(update={"keys": own})
    return entry.model_copy(update={"takes": {**entry.takes, entry.take: take}})
