"""The whole job on the synthetic speaker, undisturbed and killed at every stage."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubbing import media
from dubbing.identity.learned import MODEL_FILE
from dubbing.workshop.synthetic.speaker import make_speaker
from tests.dubbing.batch.test_interruptions import tree

# As long as the sync check needs, and learned well enough to pass it.
SIZE, LEARNED, SECONDS = 96, 2.4, 3.12
WORDS = (
    "Good morning, my friends. Before we begin, please move your papers from the table and put a"
    " pen beside them. Maybe both of you have been here before."
)
# Stages, and files that each in the middle of its work gives their names: the run is killed before.
MOMENTS = {
    "identities/someone/prepare": r"prepare\.partial-",
    "identities/someone/finetune": r"finetune\.partial-.*/resume/state\.safetensors",
    "dubs/words/cues/*/render": r"render\.partial-.*/000000\.mkv",
    "dubs/words/composite": r"composite\.partial-",
}
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
    finetune: {{iterations: 12, rays: 512}}
dubs:
  - {{name: words, identity: someone, audio: {audio}, audio_seconds: {seconds}, frame: full}}
"""


def run(manifest: Path, kill_at: str = "") -> int:
    """Exit code of `dfrf dub`; with a pattern it is killed when such a file is ready."""
    start = ["-c", KILLED, kill_at] if kill_at else ["-m", "dubbing"]
    command = [sys.executable, *start, "dub", str(manifest), "--device", "cpu"]
    return subprocess.run(command, check=False).returncode


def results(out: Path) -> dict[str, str]:
    """Digests of what a run made, but for the curve of a training, which holds seconds."""
    made = tree(out).items()
    return {name: of for name, of in made if "finetune" not in name or name.endswith(MODEL_FILE)}


@pytest.mark.slow
def test_a_run_killed_at_every_stage_ends_like_one_that_was_not(tmp_path: Path) -> None:
    make_speaker(tmp_path / "source", text=WORDS, seconds=SECONDS, size=SIZE, motion=0.3)
    clip, out = tmp_path / "source" / "clip.mp4", tmp_path / "out"
    manifest = tmp_path / "m.yaml"
    paths = {"output": out, "clip": clip, "audio": clip}
    manifest.write_text(MANIFEST.format(**paths, size=SIZE, learned=LEARNED, seconds=SECONDS))

    assert run(manifest) == 0
    calm = results(out)
    for stage, moment in MOMENTS.items():  # what was killed before is made here, or by the last run
        (folder,) = (out / "work").glob(stage)
        shutil.rmtree(folder)
        assert run(manifest, moment) == -signal.SIGKILL, stage
        assert not folder.exists()
    for published in out.glob("words.*"):
        published.unlink()
    assert run(manifest) == 0
    assert results(out) == calm

    dub = out / "words.mp4"
    info = media.probe(dub)
    assert info.frames == media.count_frames(dub) == round(SECONDS * 25)
    assert info.audio_rate == 48000
    found = json.loads((out / "words.sync.json").read_text())
    assert (found["verdict"], found["offset_frames"]) == ("pass", 0)
    assert len(found["curve"]) == 31
    assert "words.mp4" in (out / "report.html").read_text()
