"""How long a run will take, and what it needs, before anything starts.

A stage's time grows with its amount: frames, steps or seconds of speech. How fast this machine is
comes from stages of the manifest that are done, else from `dfrf doctor --calibrate`.
"""

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
from dubbing.homes import cache_folder
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


def rates_file() -> Path | None:
    """Where the rates of this machine are kept; nowhere for a user without a home."""
    folder = cache_folder()
    return folder / "rates.json" if folder else None


def amount(manifest: Manifest, node: Node) -> float:
    """What the time of a stage grows with: frames, steps or seconds."""
    work, job = node.stage.produce, node.job
    found: float
    match work:
        case tasks.Listen():
            found = work.cue.seconds
        case tasks.Prepare():
            clip = manifest.media[work.clip]
            found = clip.frames * _area(work.identity, clip)
        case tasks.RefinePoses():
            clip = manifest.media[work.prepared.clip]
            found = clip.frames * _area(manifest.identities[job.name], clip)
        case tasks.Finetune():
            clip = manifest.media[work.identity.clip]
            refined = REFINED * _learned(manifest, work.identity) * _area(work.identity, clip)
            found = tasks.iterations_of(work.identity) + refined
        case tasks.Render():
            clip = manifest.media[work.prepared.clip]
            found = work.frames * _area(manifest.identities[work.cue.identity], clip)
        case tasks.Composite() if work.dub.lines is not None:
            found = manifest.media[work.scene.clip].frames
        case tasks.Composite():
            found = _spoken_frames(work.scene)
        case tasks.Check() if job.kind == "dub":
            found = _spoken_frames(manifest.scenes[job.name])
        case tasks.Check():
            found = manifest.media[work.video].frames
        case tasks.Sign():  # bytes are copied and digested: far quicker than any frame is made
            found = _spoken_frames(manifest.scenes[job.name])
        case _:
            raise TypeError(f"no stage of a pipeline: {work}")
    return found


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
    if (path := rates_file()) is None:
        return {}
    try:
        return json_records.read(path, dict[str, Rate], "rates of this machine")
    except DubbingError:
        return {}


def keep(rates: Mapping[str, Rate]) -> Path:
    """Write the rates of this machine; gives the file."""
    path = rates_file()
    assert path is not None  # `doctor` has looked
    atomic_write_json(path, {name: asdict(rate) for name, rate in rates.items()})
    return path


def estimate(manifest: Manifest, jobs: Jobs, rows: list[Row]) -> Estimate:
    """What a run of these jobs needs; ``rows``: from `planner.rows`."""
    rates = {**calibrated(), **measured(manifest, nodes(jobs))}
    graph = nodes(jobs, split=lambda stage: True)
    wanted = {f"{row.job.label}/{row.stage}" for row in rows if row.state in ("run", "after")}
    seconds, disk, memory = {}, 0.0, 0.0
    unknown = []
    for key, node in graph.items():
        stage = node.stage
        whole = key.removesuffix(f" {stage.of}") if isinstance(stage, Part) else key
        if whole not in wanted or stage.parts:  # its parts take the time of a stage
            continue
        memory = max(memory, _memory(manifest, stage.produce))
        if rate := rates.get(stage.name):
            many = amount(manifest, node)
            seconds[key], disk = rate.seconds * many, disk + rate.bytes * many
        else:
            unknown.append(stage.name)
    two = simulate(graph, seconds, 2)
    longest = sum(seconds.get(key, 0.0) for key in two.critical)
    missing = tuple(dict.fromkeys(unknown))
    return Estimate(sum(seconds.values()), two.seconds, longest, disk, memory, missing)


def _spoken_frames(scene: Scene) -> int:
    return sum(cue.stop - cue.first for cue in scene.cues)


def _learned(manifest: Manifest, identity: Identity) -> float:
    """Frames that a person is learned from."""
    clips = [manifest.media[clip] for clip in identity.learned_clips]
    wanted = identity.learned_seconds * float(clips[0].rate)
    return min(sum(clip.frames for clip in clips), wanted)


def _area(identity: Identity, clip: MediaInfo) -> float:
    """Area of a head crop, as a share of a crop of `FULL_SIZE`."""
    return (min(identity.size, clip.width, clip.height) / FULL_SIZE) ** 2


def _memory(manifest: Manifest, work: Produce) -> float:
    if not isinstance(work, tasks.Finetune):
        return HELD
    pixels = FULL_SIZE**2 * _area(work.identity, manifest.media[work.identity.clip])
    return HELD + A_PIXEL * _learned(manifest, work.identity) * pixels
