"""The run of all that is measured on a GPU: its parts exist, are limited, and are resumed."""

import subprocess
import sys
from pathlib import Path

import pytest

from dubbing.manifest.manifest import load
from dubbing.workshop.bench.gpu_day import (
    DONE,
    FAILED,
    STOPPED,
    Part,
    parts_of,
    run_all,
    write_manifests,
)
from tests import clips


def says(text: str, then: str = "") -> tuple[str, ...]:
    return "-c", f"print({text!r}, flush=True)\n{then}"


def test_parts_are_limited_and_those_done_are_not_done_again(tmp_path: Path) -> None:
    parts = [
        Part("one", says("40.5 dB | 3 frames", "open('made', 'a').write('x')")),
        Part("two", says("step 7", "import time\ntime.sleep(60)"), limit=3.0),
        Part("three", says("no model", "raise SystemExit(2)")),
    ]
    parts[0] = Part(
        "one", [p.replace("'made'", repr(str(tmp_path / "made"))) for p in parts[0].call]
    )
    for _ in range(2):
        outcomes = run_all(parts, tmp_path, minutes=1)
        assert [o.how for o in outcomes] == [DONE, STOPPED, FAILED]
    assert (tmp_path / "made").read_text() == "x"
    assert outcomes[1].seconds < 30
    table = (tmp_path / "table.md").read_text().splitlines()
    assert table[2] == f"| one | done | {outcomes[0].seconds:.0f} | 0.0 | 40.5 dB / 3 frames |"
    assert table[3].endswith("| step 7 |")
    assert table[4].startswith("| three | failed |")
    # Without time nothing begins.
    assert [o.name for o in run_all(parts, tmp_path, minutes=0)] == ["one"]


@pytest.mark.parametrize("part", parts_of(Path("out"), "cpu"), ids=lambda part: part.name)
def test_a_part_is_a_call_that_exists(part: Part) -> None:
    asked = subprocess.run(
        [sys.executable, *part.call, "--help"], capture_output=True, text=True, check=False
    )
    assert asked.returncode == 0, asked.stderr
    assert all(word in asked.stdout for word in part.call if word.startswith("--"))


def test_its_manifests_are_valid(tmp_path: Path) -> None:
    source = tmp_path / "demo" / "source"
    source.mkdir(parents=True)
    clips.write_clip(source / "clip.mp4", 40)
    clips.write_sound(source / "italian.wav", 1.0)
    write_manifests(tmp_path)
    person, paper = (load(tmp_path / f"{name}.yaml") for name in ("person", "paper"))
    assert person.people["alba"].settings.iterations == 1000
    assert paper.people["alba"].settings.preset == "paper"
    assert list(person.dubs) == ["it"]
