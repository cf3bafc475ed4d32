"""A machine that fails: processes killed at any time, a disk that fills up, an ffmpeg that lies."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dubbing.engine.environment import of_children, python
from tests.attack import rule
from tests.attack.conftest import TIMES, Room
from tests.attack.odd import cases
from tests.attack.test_manifests import WHOLE
from tests.dubbing.batch.test_interruptions import tree

pytestmark = pytest.mark.medium


KILLS = 20 * TIMES or 4
# Each is a line of a shell script that stands in for ffmpeg; `real` is the true one.
LIES = {
    "does nothing": "exit 0",
    "fails without a word": "exit 1",
    "fails with odd words": r"printf '\033[31mbad\007 \377\n' >&2; exit 234",
    "is killed": "kill -9 $$",
    "gives other bytes": "head -c 5000 /dev/zero; exit 0",
    "stops half way": 'real "$@" | head -c 20000; exit 0',
    "fails after its work": 'real "$@"; exit 1',
}


@pytest.fixture(scope="module")
def whole(room: Room, stand_ins: None) -> dict[str, str]:
    """Digests of what an undisturbed run makes."""
    with room() as folder:
        written(folder)
        assert rule.call("dub", "m.yaml").code == 0
        return tree(folder / "out")


def written(folder: Path) -> None:
    (folder / "m.yaml").write_text(json.dumps(WHOLE))


def undisturbed(folder: Path, whole: dict[str, str]) -> None:
    """The next run makes what is missing, to the bit, and leaves nothing beside it."""
    again = rule.call("dub", "m.yaml")
    assert again.code == 0, again
    assert tree(folder / "out") == whole


def test_processes_that_are_killed_at_any_time(room: Room) -> None:
    """With what they started, or alone; one run after another in one folder."""
    chance = random.Random(TIMES)
    with room() as folder:
        written(folder)
        command = [*python("tests.fakes"), "dub", str(folder / "m.yaml")]

        def begun() -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                command, env=of_children(), stdout=subprocess.DEVNULL, start_new_session=True
            )

        began = time.monotonic()
        assert begun().wait() == 0
        seconds, made = time.monotonic() - began, tree(folder / "out")
        shutil.rmtree(folder / "out")
        kills = 0
        while kills < KILLS:
            process = begun()
            try:
                process.wait(timeout=chance.uniform(0.3, 1) * seconds)
            except subprocess.TimeoutExpired:
                end = chance.choice((os.kill, os.killpg))
                end(process.pid, signal.SIGKILL)
                process.wait()
                kills += 1
                rule.TALLY.add("killed", rule.Ending(-signal.SIGKILL, "", ""), [])
                continue
            assert process.returncode == 0
            assert tree(folder / "out") == made
            shutil.rmtree(folder / "out")
        assert begun().wait() == 0
        assert tree(folder / "out") == made


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[None]:
    """A disk of so many kB below a folder.

    Skips the test where the machine lets nobody mount one.
    """
    folder.mkdir()
    how = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "dfrf", str(folder)]
    if (
        not shutil.which("mount")
        or subprocess.run(how, capture_output=True, check=False).returncode
    ):
        pytest.skip("only root can mount a small disk")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)
        folder.rmdir()


@given(st.integers(4, 600))
@cases(3)
def test_a_disk_that_fills_up(room: Room, whole: dict[str, str], kilobytes: int) -> None:
    with room() as folder, small_disk(folder / "out", kilobytes):
        written(folder)
        ending = rule.judge("full disk", folder, "dub", "m.yaml")
        assert ending.code == 0 or "No space left" in ending.out + ending.err, ending
        larger = ["mount", "-o", "remount,size=1g", str(folder / "out")]
        subprocess.run(larger, check=True)
        undisturbed(folder, whole)


@given(st.sampled_from(sorted(LIES)), st.integers(1, 30), st.booleans())
@cases(5)
def test_an_ffmpeg_that_lies(
    room: Room,
    whole: dict[str, str],
    tmp_path_factory: pytest.TempPathFactory,
    lie: str,
    call: int,
    once: bool,
) -> None:
    """In one of its calls, or from one on."""
    program = tmp_path_factory.mktemp("liar") / "ffmpeg"
    program.write_text(
        f"#!/bin/sh\nreal() {{ '{imageio_ffmpeg.get_ffmpeg_exe()}' \"$@\"; }}\n"
        f"n=$(($(cat '{program}.calls') + 1)); echo $n > '{program}.calls'\n"
        f"if [ $n -{'eq' if once else 'ge'} {call} ]; then {LIES[lie]}; fi\n"
        'real "$@"\n'
    )
    program.chmod(0o755)
    program.with_suffix(".calls").write_text("0")
    with room() as folder:
        written(folder)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("DFRF_FFMPEG", str(program))
            ending = rule.judge(f"ffmpeg {lie}", folder, "dub", "m.yaml")
        if ending.code == 0:
            assert tree(folder / "out") == whole
        undisturbed(folder, whole)
