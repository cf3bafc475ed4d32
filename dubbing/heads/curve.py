"""The loss curve of a training as files: CSV, and an event file that TensorBoard shows."""

from __future__ import annotations

import csv
import importlib.util
import io
from contextlib import closing
from pathlib import Path

from dfrf.training.progress import Curve
from dubbing.engine.disk.files import atomic_path, atomic_write_text

EVENTS_FILE = "events.out.tfevents.loss"  # TensorBoard looks for "tfevents" in a name


def write_curve(path: Path, curve: Curve) -> None:
    """The curve as CSV: step, loss, PSNR in dB, seconds."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["step", "loss", "psnr", "seconds"])
    rows.writerows(curve.rows)
    atomic_write_text(path, text.getvalue())


def write_events(folder: Path, curve: Curve) -> None:
    """The curve as scalars `loss` and `psnr` in FOLDER/events.out.tfevents.loss.

    Nothing is written where tensorboardX, the extra `tensorboard`, is not installed. Times are
    seconds since the run began.
    """
    if importlib.util.find_spec("tensorboardX") is None:
        return
    from tensorboardX.proto.event_pb2 import Event
    from tensorboardX.proto.summary_pb2 import Summary
    from tensorboardX.record_writer import RecordWriter

    with (
        atomic_path(folder / EVENTS_FILE) as temporary,
        closing(RecordWriter(str(temporary))) as records,
    ):
        records.write(Event(wall_time=0.0, file_version="brain.Event:2").SerializeToString())
        for step, loss, psnr, seconds in curve.rows:
            values = [
                Summary.Value(tag=tag, simple_value=value)
                for tag, value in (("loss", loss), ("psnr", psnr))
            ]
            event = Event(wall_time=seconds, step=step, summary=Summary(value=values))
            records.write(event.SerializeToString())
