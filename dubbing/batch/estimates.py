"""How long a run will take, and what it needs: known before anything starts.

A stage's time grows with its amount: frames, steps or seconds of speech. How fast this machine is
comes from stages of the manifest that are done, else from `dfrf doctor --calibrate`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from dubbing import json_records, tasks
from dubbing.engine.graph import Jobs, Node, nodes
from dubbing.engine.part import Part
from dubbing.engine.planner import Row
from dubbing.engine.schedule import simulate
from dubbing.engine.stage import Produce
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json
from dubbing.manifest.entries import Identity
from dubbing.manifest.findings import Scene
from dubbing.manifest.manifest import Manifest
from dubbing.media import MediaInfo

FULL_SIZE = 512  # px of a crop whose frame counts as one
REFINED = 0.5  # steps of learning that the poses of a learned frame are worth
# Bytes that a process holds: torch and the models; and a learned frame, each pixel of its crop.
HELD, A_PIXEL = 0.8e9, 24


@dataclass(frozen=True)
class Rate:
    """What one of a stage's amount takes: seconds, and bytes of its results."""

    seconds: float
    bytes: float


@dataclass(frozen=True)
class Estimate:
    """What a run needs.

    Attributes:
        seconds: of one process; two: of two side by side; longest: of any number, the chain of
            stages that need one another.
        disk: bytes of the results.
        memory: bytes of the process that needs most.
        unknown: stages whose time nobody has measured.
    """

    seconds: float
    two: float
    longest: float
    disk: float
    memory: float
    unknown: tuple[str, ...]


def rates_file() -> Path:
    """Where the rates of this machine are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "dfrf" / "rates.json"


def amount(manifest: Manifest, node: Node) -> float:
    """What the time of a stage grows with."""
    work = node.stage.produce
    if isinstance(work, tasks.Listen):
        return work.cue.seconds
    if isinstance(work, tasks.Composite):
        return _frames_of(manifest, work.scene, whole=work.dub.lines is not None)
    if isinstance(work, tasks.Check) and node.job.kind == "dub":  # the frames of its cues alone
        return _frames_of(manifest, manifest.scenes[node.job.name], whole=False)
    clip = manifest.media[_clip_of(work)]
    if isinstance(work, tasks.Check):
        return clip.frames
    if isinstance(work, tasks.Render):
        identity, frames = manifest.identities[work.cue.identity], work.frames
    else:
        identity, frames = manifest.identities[node.job.name], clip.frames
    area = _pixels(identity, clip) / FULL_SIZE**2
    if isinstance(work, tasks.Finetune):
        return tasks.iterations_of(identity) + REFINED * _learned(identity, clip) * area
    return frames * area


def measured(manifest: Manifest, graph: Mapping[str, Node]) -> dict[str, Rate]:
    """Rates by kind of stage, medians over those that are done."""
    found: dict[str, list[Rate]] = {}
    for node in graph.values():
        record = node.stage.record()
        if record is not None and (many := amount(manifest, node)):
            size = sum(output["bytes"] for output in record["outputs"].values())
            found.setdefault(node.stage.name, []).append(
                Rate(record["seconds"] / many, size / many)
            )
    return {
        name: Rate(median(r.seconds for r in rates), median(r.bytes for r in rates))
        for name, rates in found.items()
    }


def calibrated() -> dict[str, Rate]:
    """Rates of this machine as `dfrf doctor --calibrate` measured them; none where it did not."""
    try:
        return json_records.read(rates_file(), dict[str, Rate], "rates of this machine")
    except DubbingError:
        return {}


def keep(rates: Mapping[str, Rate]) -> Path:
    """Write the rates of this machine; gives the file."""
    path = rates_file()
    atomic_write_json(path, {name: asdict(rate) for name, rate in rates.items()})
    return path


def estimate(manifest: Manifest, jobs: Jobs, rows: list[Row]) -> Estimate:
    """What a run of these jobs needs; ``rows``: from `planner.rows`."""
    rates = {**calibrated(), **measured(manifest, nodes(jobs))}
    graph = nodes(jobs, split=lambda stage: True)
    wanted = {f"{row.job.label}/{row.stage}" for row in rows if row.state in ("run", "after")}
    seconds, disk, memory = {}, 0.0, 0.0
    unknown = []
    for node_key, node in graph.items():
        key = (
            node_key.removesuffix(f" {node.stage.of}") if isinstance(node.stage, Part) else node_key
        )
        if key not in wanted or node.stage.parts:  # which take the time of the stage
            continue
        memory = max(memory, _memory(manifest, node))
        if rate := rates.get(node.stage.name):
            many = amount(manifest, node)
            seconds[node_key], disk = rate.seconds * many, disk + rate.bytes * many
        else:
            unknown.append(node.stage.name)
    two = simulate(graph, seconds, 2)
    longest = sum(seconds.get(key, 0.0) for key in two.critical)
    missing = tuple(dict.fromkeys(unknown))
    return Estimate(sum(seconds.values()), two.seconds, longest, disk, memory, missing)


def _clip_of(work: Produce) -> Path:
    """The clip that a stage looks at: each of a person's has stages of its own."""
    match work:
        case tasks.Prepare(clip=clip) | tasks.Check(video=clip):
            return clip
        case tasks.Finetune() | tasks.RefinePoses() | tasks.Render():
            return work.prepared.clip
    raise TypeError(f"no stage of a pipeline: {work}")


def _frames_of(manifest: Manifest, scene: Scene, *, whole: bool) -> int:
    """Frames of a scene's film, or of its cues alone."""
    if whole:
        return manifest.media[scene.clip].frames
    return sum(cue.stop - cue.first for cue in scene.cues)


def _learned(identity: Identity, clip: MediaInfo) -> float:
    """Frames of a clip that are learned from."""
    assert clip.rate is not None
    return min(clip.frames, identity.learned_seconds * float(clip.rate))


def _pixels(identity: Identity, clip: MediaInfo) -> float:
    """Of a crop, whose side is the requested one, or that of the film."""
    return min(identity.size, clip.width, clip.height) ** 2


def _memory(manifest: Manifest, node: Node) -> float:
    if not isinstance(node.stage.produce, tasks.Finetune):
        return HELD
    identity = manifest.identities[node.job.name]
    clip = manifest.media[identity.clip]
    return HELD + A_PIXEL * _learned(identity, clip) * _pixels(identity, clip)
