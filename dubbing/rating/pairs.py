"""Pairs of dubs on a blind page, and the key that says which was which.

Which of two is first, and the order of the pairs, are drawn by digests of the videos: the same
videos always make the same page. Of each two versions, each is first in half of the pairs.
"""

import shutil
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Literal, NamedTuple

from typing_extensions import TypedDict

from dubbing import design
from dubbing.design.filled import filled
from dubbing.engine.disk import json_records
from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import (
    atomic_path,
    atomic_write_json,
    atomic_write_text,
    digest_data,
    make_folder,
    seen_from,
    writing,
)
from dubbing.errors import CallError, ExplainedError
from dubbing.production.production import Production

PAGE, KEY = "rate.html", "pairs.json"
DIGITS = 12  # of a digest, in the name of a video and of a pair


class Measured(TypedDict, total=False):
    """The part of a sync check that the key keeps."""

    closeness: float | None
    parts: dict[str, float]


class Side(TypedDict):
    """One of the two: which of the versions, the name of its copy, and its closeness."""

    version: int
    video: str
    closeness: float | None
    parts: dict[str, float]


class Pair(TypedDict):
    """Two versions of a dub."""

    id: str
    dub: str
    first: Side
    second: Side


class Key(TypedDict):
    """All pairs of a page; versions are manifests, seen from its folder."""

    dfrf_pairs: Literal[1]
    page: str
    versions: list[str]
    pairs: list[Pair]


class Made(NamedTuple):
    """A finished dub of one version."""

    version: int
    video: Path
    measured: Measured

    @property
    def digest(self) -> str:
        """Of its video."""
        return digest_of(self.video)


def write(productions: list[Production], folder: Path) -> tuple[Key, list[str]]:
    """Write the page, copies of its videos and its key; gives the key, and what is left out.

    Raises:
        CallError: two versions lie in one folder, or the folder holds the pairs of other videos.
        ExplainedError: there is no pair, or it cannot be written.
    """
    outputs = [production.output.resolve() for production in productions]
    if len(set(outputs)) < len(outputs):
        what = "two of the manifests have the same output, which holds one version of each dub"
        raise CallError(what, str(outputs[0]), "give manifests with outputs of their own")
    twos, left_out = _twos(productions)
    if not twos:
        what = "no dub of one name is made by two of the manifests with another video"
        where, last = "; ".join(left_out[:5]), productions[-1].manifest
        raise ExplainedError(what, where or str(last), f"run first: dfrf dub {last}")
    facts = [[name, *((m.version, m.digest) for m in (a, b))] for name, a, b in twos]
    page = digest_data(facts)
    if (folder / KEY).is_file() and read(folder)["page"] != page:
        what = "it holds the pairs of other videos, and answers about them need these"
        raise CallError(what, str(folder), "give another --output")
    make_folder(folder)
    pairs, turns = [], Counter[tuple[int, int]]()
    for name, *two in sorted(twos, key=lambda two: digest_data([page, two[0]])):
        who = (two[0].version, two[1].version)
        number = digest_data([page, name, *who])[:DIGITS]
        turns[who] += 1
        if (turns[who] + int(page, 16)) % 2:
            two.reverse()
        first, second = (_side(made, folder, page) for made in two)
        pairs.append(Pair(id=number, dub=name, first=first, second=second))
    versions = [seen_from(folder.resolve(), p.manifest.resolve()) for p in productions]
    pairs.sort(key=lambda pair: pair["id"])
    key = Key(dfrf_pairs=1, page=page, versions=versions, pairs=pairs)
    atomic_write_json(folder / KEY, key)
    atomic_write_text(folder / PAGE, page_of(key))
    return key, left_out


def read(folder: Path) -> Key:
    """The key of the page in a folder.

    Raises:
        ExplainedError: there is none, or a damaged one.
    """
    remedy = "give a folder that dfrf rate made, or an --output of its own"
    return json_records.read(folder / KEY, Key, "the key of the pairs", remedy)


def page_of(key: Key) -> str:
    """The HTML of the page, which names the pairs and their videos, and nothing of the versions."""
    pairs = [
        {"id": pair["id"], "first": pair["first"]["video"], "second": pair["second"]["video"]}
        for pair in key["pairs"]
    ]
    own = Path(__file__)
    parts = {
        "style": (design.FOLDER / design.STYLE).read_text(encoding="utf-8"),
        "script": own.with_name("rate.js").read_text(encoding="utf-8"),
    }
    return filled(own.with_name("rate.html"), {"page": key["page"], "pairs": pairs}, parts)


def _twos(productions: list[Production]) -> tuple[list[tuple[str, Made, Made]], list[str]]:
    """Each two versions of a dub, and which are left out."""
    twos, left_out = [], []
    for name in dict.fromkeys(name for one in productions for name in one.dubs):
        there = []
        for k, one in enumerate(productions):
            names = one.dubs[name].results() if name in one.dubs else {}
            video = one.output / names.get("proxy", names.get("video", ""))
            check = one.output / names.get("sync", "")
            if not names:
                left_out.append(f"{name}: no dub of {one.manifest}")
            elif not (video.is_file() and check.is_file()):
                left_out.append(f"{name}: not made by {one.manifest}")
            else:
                measured = json_records.read(check, Measured, "sync check", "run dfrf dub again")
                there.append(Made(k, video, measured))
        for a, b in combinations(there, 2):
            if a.digest == b.digest:
                same = " and ".join(str(productions[one.version].manifest) for one in (a, b))
                left_out.append(f"{name}: the same video in {same}")
            else:
                twos.append((name, a, b))
    return twos, left_out


def _side(made: Made, folder: Path, page: str) -> Side:
    """Copy a video under a name that tells nothing."""
    video = digest_data([page, made.digest])[:DIGITS] + made.video.suffix
    with atomic_path(folder / video) as temporary, writing(folder / video):
        shutil.copyfile(made.video, temporary)
    closeness, parts = made.measured.get("closeness"), made.measured.get("parts", {})
    return Side(version=made.version, video=video, closeness=closeness, parts=parts)
