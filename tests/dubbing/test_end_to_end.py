"""The whole job on the synthetic speaker, undisturbed and killed at every stage."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubbing import media
from dubbing.workshop.synthetic.speaker import make_speaker

# As long as the sync check needs, and learned well enough to pass it.
SIZE, LEARNED, SECONDS = 192, 6.0, 3.2
WORDS = (
    "Good morning, my friends. Before we begin, please move your papers from the table and put a"
    " pen beside them. Maybe both of you have been here before."
)
# Files that a stage in the middle of its work gives their names: the run is killed just before.
MOMENTS = (
    r"identities/someone/prepare\.partial-",
    r"identities/someone/finetune\.partial-.*/resume/.*state\.safetensors",
    r"dubs/words/cues/.*/render\.partial-.*/000000\.mkv",
    r"dubs/words/composite\.partial-",
)
KILLED = """
import os, re, signal, sys
moment = re.compile(sys.argv.pop(1))

def kill(event, details):
    if event == "os.rename" and moment.search(os.fsdecode(details[1])):
        os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(kill)
from dubbing.__main__ import main
main()
"""
MANIFEST = """\
version: 1
output: {output}
identities:
  someone:
    clip: {clip}
    seconds: {learned}
    size: {size}
    consent: {{by: "a synthetic person", reference: "tests"}}
    finetune: {{iterations: 60}}
dubs:
  - {{name: words, identity: someone, audio: {audio}, audio_seconds: {seconds}, frame: full}}
"""


def run(manifest: Path, kill_at: str = "") -> int:
    """Exit code of `dfrf dub`; with a pattern it is killed when such a file is ready."""
    start = ["-c", KILLED, kill_at] if kill_at else ["-m", "dubbing"]
    command = [sys.executable, *start, "dub", str(manifest), "--device", "cpu"]
    return subprocess.run(command, check=False).returncode


@pytest.mark.slow
def test_a_run_killed_at_every_stage_ends_like_one_that_was_not(tmp_path: Path) -> None:
    make_speaker(tmp_path / "source", text=WORDS, seconds=LEARNED, size=SIZE)
    clip = tmp_path / "source" / "clip.mp4"
    manifests = {}
    for name in ("calm", "killed"):
        manifests[name] = tmp_path / f"{name}.yaml"
        paths = {"output": tmp_path / name, "clip": clip, "audio": clip}
        text = MANIFEST.format(**paths, size=SIZE, learned=LEARNED, seconds=SECONDS)
        manifests[name].write_text(text)

    assert run(manifests["calm"]) == 0
    for moment in MOMENTS:
        assert run(manifests["killed"], moment) == -signal.SIGKILL, moment
    assert run(manifests["killed"]) == 0

    calm, killed = tmp_path / "calm" / "words.mp4", tmp_path / "killed" / "words.mp4"
    assert calm.read_bytes() == killed.read_bytes()
    info = media.probe(calm)
    assert info.frames == media.count_frames(calm) == round(SECONDS * 25)
    assert info.audio_rate == 48000
    found = json.loads((tmp_path / "killed" / "words.sync.json").read_text())
    assert (found["verdict"], found["offset_frames"]) == ("pass", 0)
    assert len(found["curve"]) == 31
    report = (tmp_path / "killed" / "report.html").read_text()
    assert "words.mp4" in report
