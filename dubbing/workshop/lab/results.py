"""The tables of docs/development/results.md: held-out figures of people over several seeds.

`dubbing.workshop.lab.evaluation` measures each seed in a folder of its own, OUTPUT/seeds/N. Figures
of the same code and settings are not measured again, so a run that was killed goes on.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from dfrf import device as devices
from dubbing.engine.disk import claims
from dubbing.engine.disk import json_records as kept
from dubbing.engine.disk.files import atomic_write_json, atomic_write_text, digest_data
from dubbing.engine.graph.code_version import code_version
from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from dubbing.pipeline import person_job
from dubbing.production.production import Production
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.workshop.lab.evaluation import (
    COMPOSITION,
    EVALUATION,
    RESULT_FILE,
    Figures,
    Progress,
    evaluate,
)
from dubbing.workshop.lab.result_tables import CHANGED, P15, P15X, SHARES, table
from dubbing.workshop.lab.variants import Variant, variants

BEGIN, END = "<!-- made by `make results` -->", "<!-- end of what `make results` made -->"
DONE_FILE = "measured.json"
CODE = "dubbing.workshop.lab.evaluation"


@dataclass(frozen=True)
class Request:
    """The measurements that are asked for, and the commit, which the document names."""

    seeds: tuple[int, ...]
    methods: tuple[Variant, ...]
    every: int
    seconds: float | None
    lpips_weights: Path | None
    device: str
    commit: str
    composition: bool = True  # whether it is measured what the pixels of a dub are made of


def with_seed(production: Production, seed: int) -> Production:
    """The same people, learned with another seed into a folder of their own."""
    people = {
        name: replace(person, settings=replace(person.settings, seed=seed))
        for name, person in production.people.items()
    }
    return replace(production, output=production.output / "seeds" / str(seed), people=people)


def measure_seeds(
    production: Production, request: Request, progress: Progress, prepared: Production | None = None
) -> list[Figures]:
    """The figures of each seed: identity -> method -> figure -> value.

    Args:
        prepared: where the clips of these people are prepared already, if they are.

    Raises:
        ExplainedError: as `evaluate` does.
    """
    with claims.hold(production.work / EVALUATION):
        first = prepared or with_seed(production, request.seeds[0])
        return [
            measure_seed(with_seed(production, seed), first, request, progress)
            for seed in request.seeds
        ]


def measure_seed(
    production: Production, first: Production, request: Request, progress: Progress
) -> Figures:
    """The figures of one seed, identity -> method -> figure -> value, in its production's output.

    Args:
        production: of this seed, as of `with_seed`.
        first: the one in whose folder clips are prepared.

    Raises:
        ExplainedError: as `evaluate` does.
    """
    path = production.output / DONE_FILE
    done = kept.read(path, dict[str, str], "list of what was measured") if path.exists() else {}
    for name in production.people:
        for method in request.methods:
            finetune = _finetune(production, name, method)
            code = code_version(CODE, finetune.packages, finetune.without_effect)
            way = digest_data([code, how(production, name, method, request)])
            key = f"{name}/{method}"
            if done.get(key) == way:
                continue
            _share_prepared(first, production, name)
            evaluate(
                production,
                methods=(method,),
                only=(name,),
                composition=request.composition,
                every=request.every,
                seconds=request.seconds,
                lpips_weights=request.lpips_weights,
                device=request.device,
                progress=progress,
            )
            done[key] = way
            atomic_write_json(path, done)
    found = kept.read(production.output / RESULT_FILE, Figures, "figures")
    methods = [str(method) for method in request.methods]
    return {name: {m: found[name][m] for m in methods} for name in production.people}


def how(production: Production, name: str, method: Variant, request: Request) -> str:
    """A digest of what figures are of, the code aside: files that are read, settings, frames."""
    finetune = _finetune(production, name, method)
    read, settings = sorted(finetune.sources().values()), dict(finetune.parameters)
    frames, lpips = (request.every, request.seconds), request.lpips_weights is not None
    size = production.people[name].size
    return digest_data([frames, lpips, request.composition, size, settings, read])


def _finetune(production: Production, name: str, method: Variant) -> Finetune:
    return person_job(method.of(production.people[name]), production.work).stage(Finetune)


def _share_prepared(first: Production, production: Production, name: str) -> None:
    """Preparing a clip knows no seed: its results are linked from the first one's folder."""
    there, here = (
        person_job(one.people[name], one.work).stage(Prepare) for one in (first, production)
    )
    if there.record() not in (None, here.record()):
        shutil.rmtree(here.folder, ignore_errors=True)
        shutil.copytree(there.folder, here.folder, copy_function=os.link)


def document(text: str, request: Request, runs: Sequence[Figures], today: datetime.date) -> str:
    """A document whose part between the markers holds the tables, and how they were made.

    Raises:
        ExplainedError: it has no such part.
    """
    dubs, made_of = (figures_of(part, runs) for part in ("p15x", COMPOSITION))
    lines = [
        *conditions(request, today),
        "",
        "**P15**, beside the true pictures:",
        "",
        *table(P15, runs),
        "",
        "**P15x**, the case of a dub:",
        "",
        *table(P15X, dubs),
    ]
    if any(made_of):
        lines += ["", "**What the replaced pixels and the mouth of a dub are made of**, shares:"]
        lines += ["", *table(SHARES, made_of)]
        lines += ["", "**The mouth to itself after a change of one part**, PSNR in dB:", ""]
        lines += table(CHANGED, made_of)
    return filled(text, (BEGIN, END), lines)


def figures_of(part: str, runs: Sequence[Figures]) -> list[Figures]:
    """Figures of one part of an evaluation, flat; only of people and methods that have it."""
    return [
        {
            name: {method: figures[part] for method, figures in found.items() if figures.get(part)}
            for name, found in run.items()
            if any(figures.get(part) for figures in found.values())
        }
        for run in runs
    ]


def filled(text: str, marks: tuple[str, str], lines: Sequence[str]) -> str:
    """A document with lines in the place of those between two marks.

    Raises:
        ExplainedError: it lacks one of them.
    """
    head, begin, rest = text.partition(marks[0])
    _, end, tail = rest.partition(marks[1])
    if not (begin and end):
        raise ExplainedError(
            "the document has no place for tables", remedy="add {} and {}".format(*marks)
        )
    return head + "\n".join([begin, "", *lines, "", end]) + tail


def conditions(request: Request, today: datetime.date) -> list[str]:
    """Lines that say how figures were measured."""
    seeds = ", ".join(map(str, request.seeds))
    frames = "every frame" if request.every == 1 else f"one frame of {request.every} (P15)"
    if request.seconds is not None:
        frames += f", {request.seconds:g} s of each protocol at most"
    return [
        f"Commit {request.commit}, seeds {seeds}, {frames}, {today:%d %B %Y}.",
        f"Machine: {machine(request.device)}.",
        "Each figure: mean ± standard deviation over the seeds.",
    ]


def machine(device: str) -> str:
    """The machine in words: processor, threads, GPU."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(errors="replace").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else platform.processor() or platform.machine()
    chosen = devices.choose(device)
    gpu = torch.cuda.get_device_name(chosen) if chosen.type == "cuda" else "no GPU"
    return f"{os.cpu_count()} cores of {processor}, torch threads: {torch.get_num_threads()}, {gpu}"


def seeds_from(text: str) -> tuple[int, ...]:
    """Two or more seeds, with commas between them.

    Raises:
        argparse.ArgumentTypeError: they are not.
    """
    try:
        seeds = tuple(sorted({int(seed) for seed in text.split(",")}))
    except ValueError as error:
        problem = f"numbers with commas between them, not {text!r}"
        raise argparse.ArgumentTypeError(problem) from error
    if len(seeds) < 2 or min(seeds) < 0:
        raise argparse.ArgumentTypeError("two or more from 0 on, for a spread")
    return seeds


def printer() -> Progress:
    """Prints messages, once each: the same one comes again with its share."""
    last = ""

    def show(message: str, _share: float) -> None:
        nonlocal last
        if message != last:
            print(message, flush=True)
            last = message

    return show


def main(arguments: Sequence[str] | None = None) -> None:
    """Measures every seed, then writes the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("manifests", nargs="+", type=Path, metavar="MANIFEST")
    parser.add_argument("--seeds", type=seeds_from, default="0,1,2", help="two or more")
    parser.add_argument("--method", action="append", help="as of `dfrf evaluate`; dfrf by default")
    parser.add_argument("--every", type=int, default=1, help="P15 takes one frame of so many")
    parser.add_argument("--seconds", type=float, help="as of `dfrf evaluate`; all by default")
    parser.add_argument("--lpips-weights", type=Path, help="as of `dfrf evaluate`")
    parser.add_argument("--device", default="auto")
    parser.add_argument(
        "--commit", default="unknown", help="of this code, as the document names it"
    )
    parser.add_argument("--document", type=Path, default=Path("docs/development/results.md"))
    given = parser.parse_args(arguments)
    if given.every < 1:
        parser.error("--every: 1 or more")
    if given.seconds is not None and not 0 < given.seconds < float("inf"):
        parser.error("--seconds: more than 0")
    how = (given.every, given.seconds, given.lpips_weights, given.device, given.commit)
    try:
        request = Request(given.seeds, variants(given.method or ["dfrf"]), *how)
        text = given.document.read_text(encoding="utf-8")
        # Before hours of work.
        document(text, request, [{} for _ in given.seeds], datetime.date.min)
        productions = [load(path) for path in given.manifests]
        names = [name for production in productions for name in production.people]
        if twice := [name for name in names if names.count(name) > 1]:
            parser.error(f"{twice[0]!r} is in two manifests: give it another name")
        runs: list[Figures] = [{} for _ in given.seeds]
        for production in productions:
            found = measure_seeds(production, request, printer())
            runs = [{**run, **more} for run, more in zip(runs, found, strict=True)]
    except (OSError, ValueError, ExplainedError) as error:
        parser.error(str(error))
    atomic_write_text(given.document, document(text, request, runs, datetime.date.today()))


if __name__ == "__main__":
    main()
