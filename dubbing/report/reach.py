"""How much of each line of a planned dub is dubbed, as far as it is known beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dubbing.engine.graph.stage_id import StageId
from dubbing.engine.planning.planner import UP_TO_DATE, Row
from dubbing.errors import ExplainedError
from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking.reach import Reach
from dubbing.production.dub import Dub
from dubbing.production.production import Production
from dubbing.report.lines import picture_of, reach_columns
from dubbing.script import timeline
from dubbing.stages.composite import Composite, PersonOnFilm
from dubbing.video.own_pixels import reach

# A prepared film, and (T,) why its frames keep their own face; None before that is known.
Film = tuple[PreparedClip, np.ndarray | None]


def planned_reach(production: Production, rows: Sequence[Row]) -> dict[str, list[dict[str, Any]]]:
    """By dub, the lines whose film is prepared, with how much of them is dubbed, or can be.

    Of a dub that is made, what its record says. Of another, what preparation saw: the learned head
    looks again at what covers a face, which is not done here.
    """
    ready = {row.stage.id for row in rows if row.stage and row.state == UP_TO_DATE}
    films: dict[StageId, Film] = {}
    found = {}
    for row in rows:
        if not isinstance(row.stage, Composite):
            continue
        dub, people = production.dubs[row.job.name], row.stage.people
        if row.state == UP_TO_DATE:
            known, what = picture_of(row.job).get("reach", {}), "dubbed"
        else:
            known, what = _expected(dub, people, ready, films), "can be dubbed"
        lines = [(cue, known[cue.name]) for cue in dub.cues if cue.name in known]
        if lines:
            found[dub.name] = [
                {"line": cue.number, "in": dub.timecode(cue.first)}
                | reach_columns(of)
                | {"reach": of.in_words(what), "short": of.short}
                for cue, of in lines
            ]
    return found


def _expected(
    dub: Dub, people: Mapping[str, PersonOnFilm], ready: set[StageId], films: dict[StageId, Film]
) -> dict[str, Reach]:
    """The reach of cues, by name, whose film is prepared. Films that are read go to ``films``."""
    found = {}
    for cue in dub.cues:
        person = people[cue.identity]
        stage = person.prepared.stage.id
        if stage not in ready:
            continue
        try:
            clip, kept = films.get(stage) or films.setdefault(stage, _film(person, ready))
            poses = timeline.pose_index(dub.length, clip.segment, dub.first, dub.on_longer_audio)
        except ExplainedError:  # a run of this dub says so
            continue
        if len(frames := poses[cue.first : cue.stop]):
            found[cue.name] = reach(clip, frames, kept)
    return found


def _film(person: PersonOnFilm, ready: set[StageId]) -> Film:
    """A prepared film; views that are too far from learned ones are known of a learned person."""
    clip = person.prepared.load()
    learned = {person.model.id, *(of.stage.id for of in person.learned)} <= ready
    return clip, person.kept(clip) if learned else None
