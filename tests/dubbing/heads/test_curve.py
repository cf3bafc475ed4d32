"""A loss curve in two kinds of file."""

import struct
from pathlib import Path

import pytest

from dfrf.training.progress import Curve
from dubbing.heads import curve as curves


@pytest.fixture
def curve() -> Curve:
    made = Curve()
    made.add(1, 0.5, 20.0, 0.25)
    made.add(2, 0.25, 23.0, 0.5)
    return made


def records(path: Path) -> list[bytes]:
    """The records of an event file: length (8 bytes), checksum (4), data, checksum (4)."""
    data, found = path.read_bytes(), []
    while data:
        (length,) = struct.unpack("<Q", data[:8])
        found.append(data[12 : 12 + length])
        data = data[16 + length :]
    return found


def test_a_row_a_step(tmp_path: Path, curve: Curve) -> None:
    curves.write_curve(tmp_path / "loss.csv", curve)
    assert (tmp_path / "loss.csv").read_text().splitlines() == [
        "step,loss,psnr,seconds",
        "1,0.5,20.0,0.25",
        "2,0.25,23.0,0.5",
    ]


def test_tensorboard_reads_the_same(tmp_path: Path, curve: Curve) -> None:
    event_pb2 = pytest.importorskip("tensorboardX.proto.event_pb2")
    curves.write_events(tmp_path, curve)
    first, *rest = (
        event_pb2.Event.FromString(record) for record in records(tmp_path / curves.EVENTS_FILE)
    )
    assert first.file_version == "brain.Event:2"
    read = [(e.step, *(value.simple_value for value in e.summary.value), e.wall_time) for e in rest]
    assert read == curve.rows
    assert [value.tag for value in rest[0].summary.value] == ["loss", "psnr"]


def test_without_its_package_there_is_no_event_file(
    tmp_path: Path, curve: Curve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    curves.write_events(tmp_path, curve)
    assert not list(tmp_path.iterdir())
