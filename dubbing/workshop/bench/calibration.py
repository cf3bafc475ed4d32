"""How fast this machine is at each stage, from a dub of a synthetic speaker that takes a minute."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from dubbing import packages
from dubbing.batch import batch, rates
from dubbing.engine.graph.graph import Job, nodes
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.engine.planning.estimates import measured
from dubbing.engine.running.outcome import Failure
from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load

TEXT = "Good morning, my friends."
SIZE, SECONDS, STEPS, DUBBED = 192, 3.0, 40, 1.0  # of the clip, the fine-tune and the dub


def calibrate(progress: Progress) -> dict[str, Rate]:
    """Measure the rates of this machine and keep them; see `dubbing.batch.rates`.

    Raises:
        ExplainedError: there is no renderer for this processor, or a stage failed.
    """
    packages.require_renderer()
    from dubbing.workshop.synthetic.speaker import make_speaker

    with tempfile.TemporaryDirectory(prefix="dfrf-") as name:
        folder = Path(name)
        progress("a synthetic speaker", 0.0)
        make_speaker(folder, text=TEXT, seconds=SECONDS, size=SIZE)
        clip = str(folder / "clip.mp4")
        consent = {"by": "a synthetic person", "reference": "dubbing/workshop/synthetic"}
        person = {"clip": clip, "seconds": SECONDS, "size": SIZE, "consent": consent}
        dub = {"identity": "someone", "audio": clip, "audio_seconds": DUBBED, "name": "words"}
        content = {
            "version": 1,
            "output": str(folder / "out"),
            "identities": {"someone": {**person, "finetune": {"iterations": STEPS}}},
            "dubs": [dub],
        }
        path = folder / "manifest.yaml"
        path.write_text(json.dumps(content), encoding="utf-8")  # which is YAML, too
        production = load(path)
        planned = batch.begin(production)
        result = batch.dub(production, planned, _Shown(progress))
        for outcome in result.outcomes.values():
            if outcome.failure:
                raise ExplainedError(f"the calibration failed: {outcome.failure}")
        found = measured(nodes(planned))
    rates.keep(found)
    return found


class _Shown:
    """The stages of the dub on one bar."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done = 0.0

    def overall(self, done: int, total: int) -> None:
        """So many of all stages are done."""
        self._done = done / total

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        """A stage starts."""
        self._progress(stage.kind, self._done)

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        """Stages are many and short: they count as a whole."""

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        """A stage is done or has failed."""
