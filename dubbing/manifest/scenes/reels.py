"""Lines of a script on the clock of one film, which may be a shot of the reel that it was made for.

A reel's script serves all its shots: each takes the lines at its own times.
"""

from dataclasses import dataclass, replace
from fractions import Fraction

from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.media import MediaInfo
from dubbing.script.line import Line, seconds_of

REMEDY = "if it is a shot of a reel, say where on it the film begins: reel_start: 1:00:00"


@dataclass(frozen=True)
class Dealt:
    """The lines of a film, counted from its first frame.

    Attributes:
        reel: whether lines may be.
    """

    lines: list[Line]
    reel: bool = False


def of_film(findings: Findings, at: KeyPath, dub: Dub, film: MediaInfo, lines: list[Line]) -> Dealt:
    """Deal the lines of a script to a film.

    Times count from the film's first frame. Those of a script that reaches beyond the film count
    from its timecode, if there is one, or from ``reel_start``.
    """
    name = dub.lines.name if dub.lines else ""
    bases = _bases(film, lines)
    if dub.reel_start is not None:
        try:
            bases = dict.fromkeys((True, False), seconds_of(dub.reel_start, film.timecode_rate))
        except ValueError as error:
            findings.add((*at, "reel_start"), str(error))
            return Dealt([])
    elif bases[False]:
        findings.warnings.append(f"{dub.name}: times of {name} count from {film.timecode}")
    elif film.drops and bases[True] and any(line.counted and not line.drops for line in lines):
        what = f"{name} has timecodes as 01:00:00:00, and its film drops frames: write 01:00:00;00"
        findings.warnings.append(f"{dub.name}: {what}")
    dealt, elsewhere = [], 0
    for line in lines:
        base = bases[line.counted]
        if base is None:
            dealt.append(line)
            continue
        moved = replace(line, start=line.start - base, stop=line.stop - base)
        inside = round(moved.stop * film.rate) > 0 and round(moved.start * film.rate) < film.frames
        dealt += [moved] if inside else []
        elsewhere += not inside
    if not dealt:
        base = next(base for base in bases.values() if base is not None)
        place = f"{_clock(base)} to {_clock(base + film.frames / film.rate)}"
        findings.add((*at, "lines"), f"no line of {name} lies in the film, which is {place} of it")
    elif elsewhere:
        what = f"{elsewhere} of {len(lines)} lines of {name} are of other shots than the film"
        findings.warnings.append(f"{dub.name}: {what}")
    return Dealt(dealt, any(base is not None for base in bases.values()))


def _bases(film: MediaInfo, lines: list[Line]) -> dict[bool, Fraction | None]:
    """Where the film begins on the clock of timecodes (True), and on that of other times.

    None where it begins with the script, and whatever lies outside is a mistake.
    """
    if not film.timecode:
        return {True: None, False: None}
    offset, end = film.first_frame / film.rate, film.frames / film.rate
    counted = [line for line in lines if line.counted]
    clock = [line for line in lines if not line.counted]
    bases: dict[bool, Fraction | None] = {True: None, False: None}
    if any(line.stop > offset for line in counted):
        bases[True] = offset
    # At 24000/1001 a second a clock may count the timecode's seconds or real ones: nobody knows.
    real = film.rate.denominator == 1 or film.drops
    beyond = any(line.stop > end + 1 / film.rate for line in clock)
    if real and beyond and any(offset < line.stop and line.start < offset + end for line in clock):
        bases[False] = offset
    return bases


def _clock(seconds: Fraction) -> str:
    minutes, rest = divmod(float(seconds), 60)
    hours, minutes = divmod(int(minutes), 60)
    return f"{hours}:{minutes:02d}:{rest:06.3f}"
