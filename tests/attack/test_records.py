"""Files of ours that a crash, a disk or somebody made to something else; odd file names."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.attack import rule
from tests.attack.conftest import Room
from tests.attack.odd import NAMES, cases, damaged, names, numbers, plain, spoilt
from tests.attack.test_manifests import WHOLE

pytestmark = [pytest.mark.medium, pytest.mark.usefixtures("stand_ins")]


@pytest.fixture(scope="module")
def finished(material: Path, stand_ins: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole run: what it read, and `out`."""
    folder = tmp_path_factory.mktemp("finished") / "room"
    shutil.copytree(material, folder)
    (folder / "m.yaml").write_text(json.dumps(WHOLE))
    ending = rule.call("dub", folder / "m.yaml")
    assert ending.code == 0, ending
    return folder


def records(folder: Path) -> list[str]:
    """Names of all files of ours that are text, and of the lock."""
    kinds = (".json", ".csv", ".txt", ".html", ".lock")
    found = (p for p in (folder / "out").rglob("*") if p.suffix in kinds or p.name in kinds)
    return sorted(p.relative_to(folder).as_posix() for p in found)


@st.composite
def odd_record(draw: st.DrawFn, whole: bytes, suffix: str) -> bytes:
    act = draw(st.sampled_from(("shape", "shape", "shape", "bytes", "nested", "empty")))
    if act == "nested":
        return b"[" * draw(st.sampled_from((100, 100_000)))
    if act == "empty":
        return b""
    if act == "shape" and suffix == ".json":
        data: Any = draw(spoilt(json.loads(whole), 4))
        return json.dumps(data).encode(errors="surrogatepass")
    if act == "shape" and suffix == ".csv":
        rows = draw(st.lists(st.lists(plain, max_size=5), max_size=4))
        text = io.StringIO()
        csv.writer(text).writerows([["step", "loss", "psnr", "seconds"], *rows])
        return text.getvalue().encode(errors="replace")
    return draw(damaged(whole or b"x"))


@given(st.data())
@cases(12)
def test_records_of_another_shape(room: Room, finished: Path, data: st.DataObject) -> None:
    with room() as folder:
        shutil.rmtree(folder)
        shutil.copytree(finished, folder, symlinks=True)
        before = (folder / "out" / "it.mp4").read_bytes()
        os.chdir(folder)
        for name in data.draw(
            st.lists(st.sampled_from(records(folder)), min_size=1, max_size=3, unique=True)
        ):
            path = folder / name
            content = data.draw(odd_record(path.read_bytes(), path.suffix))
            path.write_bytes(content)
        rule.judge("records: plan", folder, "plan", "m.yaml", reads_only=True)
        ending = rule.judge("records: dub", folder, "dub", "m.yaml")
        if "the list of results" in ending.err:  # whose the results are is not guessed
            assert ending.code == 2, ending.err
        else:
            assert ending.code in (0, 3), ending.out  # what is damaged is made again
        assert (folder / "out" / "it.mp4").read_bytes() == before


@given(st.data())
@cases(8)
def test_what_lies_in_the_place_of_a_record(
    room: Room, finished: Path, data: st.DataObject
) -> None:
    with room() as folder:
        shutil.rmtree(folder)
        shutil.copytree(finished, folder, symlinks=True)
        os.chdir(folder)
        place = folder / data.draw(st.sampled_from([*records(folder), "out/it.mp4", "out/work"]))
        if place.is_dir():
            shutil.rmtree(place)
        else:
            place.unlink()
        what = data.draw(st.sampled_from(("folder", "fifo", "link", "dangling", "loop", "device")))
        if what == "folder":
            (place / "inside").mkdir(parents=True)
        elif what == "fifo":
            os.mkfifo(place)
        else:
            targets = {"link": folder / "it.wav", "loop": place, "device": Path("/dev/zero")}
            place.symlink_to(targets.get(what, folder / "nowhere"))
        rule.judge("records: no file, plan", folder, "plan", "m.yaml", reads_only=True)
        rule.judge("records: no file, dub", folder, "dub", "m.yaml")


FILES = [n for n in NAMES if n not in ("", ".", "..") and "/" not in n and "\0" not in n]
file_names = st.sampled_from([n for n in FILES if len(os.fsencode(n)) < 250])


@given(file_names, file_names)
@cases(20)
def test_odd_names_in_a_folder(room: Room, clip: str, sound: str) -> None:
    with room() as folder:
        (folder / "out").mkdir()
        os.rename(folder / "ann.mp4", os.path.join(folder, "out", f"{clip}"))
        os.rename(folder / "it.wav", os.path.join(folder, "out", f"{sound}.wav"))
        if rule.judge("names: init", folder, "init", "out").code == 0:
            path = folder / "out" / "manifest.yaml"
            path.write_text(path.read_text().replace('""', '"Ann Smith, form 17"'))
            rule.judge("names: plan", folder, "plan", path, reads_only=True)


@given(file_names, st.sampled_from(("plan", "verify", "sync", "init", "prepare", "evaluate")))
@cases(20)
def test_odd_names_in_a_call(room: Room, name: str, command: str) -> None:
    with room() as folder:
        path = folder / name
        path.write_bytes(b"no film")
        more = ("--out", "out") if command == "prepare" else ()
        rule.judge("names: call", folder, command, *more, "--", path)


OPTIONS = (
    ("dub", "--only"),
    ("dub", "--force"),
    ("dub", "--device"),
    ("dub", "--jobs"),
    ("plan", "--only"),
    ("evaluate", "--seconds"),
    ("evaluate", "--every"),
    ("evaluate", "--method"),
    ("evaluate", "--protocol"),
    ("evaluate", "--only"),
    ("train-base", "--iterations"),
    ("train-base", "--hold-out"),
)


@given(st.sampled_from(OPTIONS), names | numbers.map(repr))
@cases(30)
def test_odd_values_of_options(room: Room, option: tuple[str, str], value: str) -> None:
    with room() as folder:
        (folder / "m.yaml").write_text(json.dumps({**WHOLE, "identities": {}}))
        command, name = option
        more = ("--out", "out/b.safetensors") if command == "train-base" else ()
        rule.judge("names: options", folder, command, "m.yaml", *more, f"{name}={value}")
