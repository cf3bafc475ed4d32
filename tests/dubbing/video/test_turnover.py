"""Frames that are delivered beside a video: layers over the film, whole frames, their proof."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing import media
from dubbing.engine.disk.numbered import with_options
from dubbing.errors import RenderingError
from dubbing.media.sequences import image_files, sequence
from dubbing.mixing.sound import Sound
from dubbing.preparation.prepared import OVERLAY, PreparedClip
from dubbing.script.timeline import Cue
from dubbing.video import turnover
from dubbing.video.assembly import make
from dubbing.video.files import DELIVERED, PICTURE_FILE
from dubbing.video.heads import Heads, read_heads
from dubbing.video.own_pixels import reasons, views
from dubbing.video.settings import VideoSettings
from tests import clips, fakes, sequences

pytestmark = pytest.mark.medium

FRAMES, WIDTH, HEIGHT = 6, 96, 64
WINDOW = (40, 20, 32)
NAMES = [f"shot.{number}.exr" for number in range(1001, 1001 + FRAMES)]


def plates(kind: str) -> list[np.ndarray]:
    """Noise on a ramp that ends at 1,000 nits where white is 100, and goes below black."""
    rng = np.random.default_rng(1)
    ramp = (
        10
        * np.linspace(-0.4, 1, WIDTH)[None, :, None] ** 5
        * rng.uniform(0.5, 1, (FRAMES, 1, 1, 1))
    )
    ramp = ramp * rng.uniform(0.9, 1, (FRAMES, HEIGHT, WIDTH, 3))
    if kind == "half":
        return list(ramp.astype(np.float16))
    log = np.linspace(0.1, 0.6, WIDTH)[:, None] * rng.uniform(0.9, 1, (FRAMES, HEIGHT, WIDTH, 3))
    ten = (log * 1023).astype(np.uint16)
    return list((ten << 6) | (ten >> 4))


class Shot:
    """An image sequence, its fake preparation with something in front in one frame, and heads."""

    def __init__(self, folder: Path, name: str, options: dict[str, str]) -> None:
        self.folder = folder
        kind = "half" if name.endswith("exr") else "ten"
        tags: dict[str, Any] = {"rate": 24} if kind == "half" else {"oiio__BitsPerSample": 10}
        self.stored = plates(kind)
        plain = sequences.write_sequence(
            folder / "film" / name, self.stored, timecode=0x01000000, **tags
        )
        self.clip = with_options(plain, {"rate": "24", **options})
        prepared = folder / "prepared"
        fakes.write_prepared(self.clip, prepared, window=WINDOW, invalid=(3,))
        over = np.zeros((fakes.SIZE, fakes.SIZE), np.uint8)
        over[14:18] = 255
        with media.VideoWriter(
            prepared / OVERLAY, fakes.SIZE, fakes.SIZE, Fraction(24), "ffv1-gray"
        ) as writer:
            for _ in range(FRAMES):
                writer.write(over)
        self.prepared = replace(
            PreparedClip.load(prepared), over=np.arange(FRAMES) == 2, clip=self.clip
        )
        self.audio = clips.write_sound(folder / "a.wav", 1, 48000, 1)

    def make(self, deliver: str) -> Path:
        """The folder of what is delivered."""
        fakes.write_heads(self.folder / "heads", FRAMES, Fraction(24))
        kept = reasons(self.prepared, views(self.prepared))
        heads = Heads(
            partial(read_heads, self.folder / "heads"), self.prepared, 0, FRAMES, kept, "it"
        )
        make(
            [heads],
            Sound((Cue("it", 0, FRAMES, self.audio, 0.0, FRAMES / 24),)),
            self.folder / "out",
            pose_index=np.arange(FRAMES),
            settings=VideoSettings(deliver=deliver, codec="ffv1", label=False),
            progress=lambda _message, _share: None,
        )
        return self.folder / "out" / DELIVERED

    def delivered(self) -> dict[str, Any]:
        found = json.loads((self.folder / "out" / PICTURE_FILE).read_text())["delivered"]
        return dict(found)


@pytest.fixture(params=[("shot.####.exr", {}), ("shot.####.dpx", {"film": "LogC4"})])
def shot(tmp_path: Path, request: pytest.FixtureRequest) -> Shot:
    return Shot(tmp_path, *request.param)


def over(film: np.ndarray, layer: Path) -> np.ndarray:
    """A layer laid over a frame (H, W, 3) of the film, as a compositor does."""
    image = image_files.read_image(layer)
    left, top = image.header.x, image.header.y
    rows, columns = image.stored.shape[:2]
    out = film.copy()
    part = out[top : top + rows, left : left + columns]
    part[...] = image.stored[..., :3] + part * (1 - image.stored[..., 3:4])
    return out


def test_a_turnover_over_the_film_is_the_finished_frame(shot: Shot) -> None:
    folder = shot.make("turnover")
    # No face is replaced in the fourth frame.
    assert sorted(path.name for path in folder.glob("*.exr")) == NAMES[:3] + NAMES[4:]
    found = shot.delivered()
    assert (found["frames"], found["outside"]) == (5, 0)
    assert found["steps"] <= 1
    values = media.probe(shot.clip).values
    video = list(media.read_frames(shot.folder / "out" / "video.mkv"))
    for k in (0, 1, 4, 5):
        film = sequence.read(shot.clip, k).values()
        made = over(film, folder / NAMES[k])
        changed = (made != film).any(-1)
        assert changed[20 + 16, 40 + 16]
        assert not changed[:, : 40 + 9].any()
        # The same as the video shows, where the film is no brighter than a display, or becomes so.
        shown = values.display(film)
        inside = ((shown >= 0) & (shown <= 1)).all(-1) & (video[k].min(-1) < 199)
        assert (changed & inside).sum() > 50
        apart = np.abs(values.picture(made).astype(int) - video[k])[inside]
        assert apart.max() <= 1


def test_the_layers_of_a_turnover(shot: Shot) -> None:
    folder = shot.make("turnover")
    image = image_files.read_image(folder / NAMES[2])
    assert tuple(image.header.channelnames) == turnover.CHANNELS
    assert str(image.header.format) == "half"
    assert image.header.get_string_attribute("smpte:TimeCode") == "01:00:00:00"
    assert "AI-generated" in image.header.get_string_attribute("ImageDescription")
    assert (image.header.full_width, image.header.full_height) == (WIDTH, HEIGHT)
    opacity, front, head = (image.stored[..., k] for k in (3, 8, 12))
    row, column = 20 + 16 - image.header.y, 40 + 16 - image.header.x
    assert (head[row, column], front[row, column], opacity[row, column]) == (1, 1, 0)
    assert front[row + 4, column] == 0
    assert opacity[row + 3, column] > 0
    colour = image.stored[row, column, 9:12][None, None]
    shown = media.probe(shot.clip).values.picture(colour)[0, 0]
    assert np.abs(shown - np.array([*fakes.HEAD[:2], 2])).max() <= 2


def test_the_script_names_both_and_the_frames(shot: Shot) -> None:
    text = (shot.make("turnover") / "over_the_film.nk").read_text()
    nodes = [line.split()[0] for line in text.splitlines() if line.endswith(" {")]
    assert nodes == ["Root", "Read", "Read", "Merge2"]  # the last before it is its input B
    assert text.index('file "shot.####.exr"') < text.index(f'file "{shot.folder.as_posix()}/film/')
    assert text.count("first 1001\n last 1006") == 2
    assert "fps 24\n" in text
    assert text.count("{") == text.count("}")


def test_whole_frames_are_the_films_but_for_the_face(shot: Shot) -> None:
    folder = shot.make("sequence")
    files = sorted(folder.iterdir())
    assert len(files) == FRAMES
    for k, path in enumerate(files):
        film, made = sequence.read(shot.clip, k), image_files.read_image(path)
        changed = (film.stored != made.stored).any(-1)
        assert changed.any() == (k != 3)
        assert not changed[: 20 + 9].any()
        assert not changed[:, : 40 + 9].any()
        assert made.header.get_string_attribute("smpte:TimeCode") == "01:00:00:00"
    assert shot.delivered()["outside"] == 0


def test_a_layer_that_is_wrong_is_not_delivered(
    shot: Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(turnover, "premultiplied", lambda made, filmed, opacity: made)
    with pytest.raises(RenderingError, match="half-float steps"):
        shot.make("turnover")


def test_a_pixel_that_changes_without_opacity_is_not_delivered(
    shot: Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stray(image: np.ndarray, *rest: Any, **how: Any) -> tuple[np.ndarray, np.ndarray]:
        out, replaced = with_faces(image, *rest, **how)
        out = out.copy()
        out[0, 0] = 255 - out[0, 0]
        return out, replaced

    from dubbing.video import composer

    with_faces = composer.with_faces
    monkeypatch.setattr(composer, "with_faces", stray)
    with pytest.raises(RenderingError, match=r"[1-9]\d* pixels changed"):
        shot.make("turnover")
