"""How long a run will take, and what it needs, before anything starts.

A stage's time grows with its amount: frames, steps or seconds of speech. How fast this machine is
comes from stages of the manifest that are done, else from `dfrf doctor --calibrate`, else from
what two cores took once.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from dfrf.config import family
from dubbing import json_records, tasks
from dubbing.engine.graph import Jobs, Node, nodes
from dubbing.engine.part import Part
from dubbing.engine.planner import Row
from dubbing.engine.schedule import simulate
from dubbing.engine.stage import Produce, Record, Stage, digest_of
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json
from dubbing.homes import cache_folder
from dubbing.manifest.entries import Identity
from dubbing.manifest.findings import Scene
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.preset_checks import FEATURES_SECONDS, FRAME_SECONDS, RAYS_SECONDS
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


# Two cores of a processor of 2026, 512 px, preset `fast`: seconds and bytes for each of the amount.
TYPICAL = {
    "prepare": Rate(0.058, 27e3),
    "check_source": Rate(0.008, 10.0),
    "finetune": Rate(0.30, 10e3),
    "refine_poses": Rate(0.048, 70.0),
    "listen": Rate(0.1, 18e3),
    "render": Rate(0.32, 15e3),
    "composite": Rate(0.04, 3e3),
    "check": Rate(0.012, 40.0),
    "sign": Rate(0.001, 3e3),
}


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
    """Rates by kind of stage, medians over those that are done, of as much as they are of now."""
    found: dict[str, list[Rate]] = {}
    for node in graph.values():
        record = node.stage.record()
        if record is None or not _as_large(node.stage, record):
            continue
        if many := amount(manifest, node):
            size = sum(output["bytes"] for output in record["outputs"].values())
            found.setdefault(kind_of_rate(manifest, node), []).append(
                Rate(record["seconds"] / many, size / many)
            )
    return {
        name: Rate(median(r.seconds for r in rates), median(r.bytes for r in rates))
        for name, rates in found.items()
    }


def _as_large(stage: Stage, record: Record) -> bool:
    """Whether a record is of the files and parameters of now: of others it says nothing here."""
    files = {name: digest_of(path) for name, path in stage.inputs.items() if isinstance(path, Path)}
    media = {name: digest for name, digest in files.items() if name in record["inputs"]}
    return record["parameters"] == dict(stage.parameters) and all(
        record["inputs"][name] == digest for name, digest in media.items()
    )


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
    rates, graph = rates_of(manifest, jobs), nodes(jobs, split=lambda stage: True)
    wanted = {f"{row.job.label}/{row.stage}" for row in rows if row.state in ("run", "after")}
    seconds, disk, memory = {}, 0.0, 0.0
    unknown = []
    for key, node in graph.items():
        stage = node.stage
        whole = key.removesuffix(f" {stage.of}") if isinstance(stage, Part) else key
        if whole not in wanted or stage.parts:  # its parts take the time of a stage
            continue
        memory = max(memory, _memory(manifest, stage.produce))
        if rate := rates.get(kind_of_rate(manifest, node)):
            many = amount(manifest, node)
            seconds[key], disk = rate.seconds * many, disk + rate.bytes * many
        else:
            unknown.append(stage.name)
    two = simulate(graph, seconds, 2)
    longest = sum(seconds.get(key, 0.0) for key in two.critical)
    missing = tuple(dict.fromkeys(unknown))
    return Estimate(sum(seconds.values()), two.seconds, longest, disk, memory, missing)


def rates_of(manifest: Manifest, jobs: Jobs) -> dict[str, Rate]:
    """The best known rates, by kind; see `kind_of_rate`."""
    slow = Rate(RAYS_SECONDS + FEATURES_SECONDS, TYPICAL["finetune"].bytes)
    paper = {"finetune paper": slow, "render paper": Rate(FRAME_SECONDS, TYPICAL["render"].bytes)}
    known = calibrated() or TYPICAL
    return {**paper, **known, **measured(manifest, nodes(jobs))}


def kind_of_rate(manifest: Manifest, node: Node) -> str:
    """The stage, and the preset `paper` behind it, where that takes a thousand times as long."""
    work, name = node.stage.produce, node.stage.name
    person = node.job.name
    if isinstance(work, tasks.Render):
        person = work.cue.identity
    elif not isinstance(work, tasks.Finetune):
        return name
    slow = family(manifest.identities[person].preset) == "paper"
    return f"{name} paper" if slow else name


def expected(manifest: Manifest, jobs: Jobs, *, parts: bool) -> dict[str, float]:
    """Seconds that stages of a run will take, by the keys of their nodes; of those that are known.

    Args:
        parts: whether they are done in parts, where they have any.
    """
    rates, found = rates_of(manifest, jobs), {}
    for key, node in nodes(jobs, split=lambda stage: parts).items():
        rate = rates.get(kind_of_rate(manifest, node))
        if rate is not None and not (parts and node.stage.parts):
            found[key] = rate.seconds * amount(manifest, node)
    return found


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
