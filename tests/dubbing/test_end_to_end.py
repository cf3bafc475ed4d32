"""The whole job on the synthetic speaker, undisturbed and killed at every stage."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dubbing import media
from dubbing.synthetic.speaker import make_speaker

SIZE, SECONDS = 192, 1.2
# Each is a file that shows that a stage is in the middle of its work.
MOMENTS = (
    "identities/someone/prepared.partial-*/**/*",
    "identities/someone/model.partial-*/resume/**/state.safetensors",
    "dubs/words/render.partial-*/000000.mkv",
    "dubs/words/video.partial-*/.*",
)
MANIFEST = """\
version: 1
output: {output}
identities:
  someone:
    clip: {clip}
    seconds: 2.2
    size: {size}
    consent: {{by: "a synthetic person", reference: "tests"}}
    finetune: {{iterations: 12}}
dubs:
  - {{name: words, identity: someone, audio: {audio}, audio_seconds: {seconds}, frame: full}}
"""


def command(manifest: Path) -> list[str]:
    dfrf = Path(sys.executable).with_name("dfrf")
    return [str(dfrf), "dub", str(manifest), "--device", "cpu"]


def killed_at(manifest: Path, work: Path, pattern: str) -> bool:
    """Runs until a file of that pattern appears, then kill -9; False if the run ended before."""
    with subprocess.Popen(command(manifest), stderr=subprocess.DEVNULL) as run:
        while run.poll() is None:
            if any(work.glob(pattern)):
                os.kill(run.pid, signal.SIGKILL)
                run.wait()
                return True
            time.sleep(0.02)
    return False


@pytest.mark.slow
def test_a_run_killed_at_every_stage_ends_like_one_that_was_not(tmp_path: Path) -> None:
    make_speaker(tmp_path / "source", text="Good morning, my friends.", seconds=3.0, size=SIZE)
    clip = tmp_path / "source" / "clip.mp4"
    manifests = {}
    for name in ("calm", "killed"):
        manifests[name] = tmp_path / f"{name}.yaml"
        paths = {"output": tmp_path / name, "clip": clip, "audio": clip}
        text = MANIFEST.format(**paths, size=SIZE, seconds=SECONDS)
        manifests[name].write_text(text)

    assert subprocess.run(command(manifests["calm"]), check=False).returncode in (0, 3)
    work = tmp_path / "killed" / "work"
    hit = [killed_at(manifests["killed"], work, pattern) for pattern in MOMENTS]
    assert sum(hit) >= 3, hit  # muxing may be over before it is seen
    assert subprocess.run(command(manifests["killed"]), check=False).returncode in (0, 3)

    calm, killed = tmp_path / "calm" / "words.mp4", tmp_path / "killed" / "words.mp4"
    assert calm.read_bytes() == killed.read_bytes()
    info = media.probe(calm)
    assert info.frames == media.count_frames(calm) == round(SECONDS * 25)
    assert info.audio_rate == 48000
    found = json.loads((tmp_path / "killed" / "words.sync.json").read_text())
    assert found["verdict"] in ("pass", "warn", "fail", "unjudged")
    assert len(found["curve"]) in (0, 31)
    report = (tmp_path / "killed" / "report.html").read_text()
    assert "words.mp4" in report
