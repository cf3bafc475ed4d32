"""The film of a dub as the page shows it: its frames, those of the draft, and what is heard."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dubbing.engine.disk.numbered import with_options
from dubbing.face.mouth.lip_curves import LENGTHS
from dubbing.script.edit import AS_SPOKEN, STYLES, Edit
from dubbing.script.timeline import Cue
from dubbing.stages.draft import Draft

if TYPE_CHECKING:
    import numpy as np

    from dubbing.face.finding.face_finder import FaceFinder
    from dubbing.stages.draft import HalfSize

QUALITY = 88  # of JPEG
FIRST_BLOCK, LONGEST_BLOCK = 2, 24  # frames that are rendered at once: the first comes soon
DRAWN = ("opening", "width")
FILM, DUB, DRAFT = "film", "dub", "draft"
MEASURED = "measured"  # lengths of the lips in frames of the draft


class Film:
    """The film of one dub with its people, at half size."""

    def __init__(self, stage: Draft) -> None:
        from dubbing.studio.kept_film import KeptFilm

        self.stage = stage
        opened = stage.opened()
        clips = {name: KeptFilm.of(clip.full) for name, clip in opened.clips.items()}  # type: ignore[attr-defined]
        self.half: HalfSize = replace(opened, clips=clips)
        self.length = len(self.half.poses)

    @cached_property
    def finder(self) -> FaceFinder:
        """Finds the landmarks of one face."""
        from dubbing.face.finding.face_finder import FaceFinder

        return FaceFinder()

    @property
    def cues(self) -> tuple[Cue, ...]:
        return self.stage.sound.cues

    def draw(
        self, kind: str, numbers: list[int], edits: dict[str, Edit], video: Path
    ) -> Generator[tuple[int, np.ndarray]]:
        """Images (H, W, 3) uint8 of frames of the dub, with their numbers."""
        import numpy as np

        from dubbing.media.reading.overlap import ahead
        from dubbing.video.composer import Composer
        from dubbing.video.files import options_of_video
        from dubbing.video.film import read_film

        heads = [self.half.heads(cue, edits.get(cue.name, Edit())) for cue in self.cues]
        composer = Composer(heads, self.half.poses, self.stage.settings)

        def read(first: int, stop: int) -> Iterator[Any]:
            if kind == DUB:
                options = options_of_video(self.stage.film, self.stage.settings.frame)
                return of_video(with_options(video, options), first, stop, composer.size)
            if kind == FILM:
                return read_film(composer.film, self.half.poses[first:stop])
            return composer.read(first, stop)

        def every() -> Iterator[Any]:
            for first, stop in blocks(numbers):
                yield from zip(range(first, stop), read(first, stop), strict=False)

        with closing(ahead(every())) as found:
            for number, one in found:
                if kind == DRAFT:
                    image, faces = one
                    pose = int(self.half.poses[number])
                    drawn = composer.frame(None, image, faces, pose, number)
                    yield number, np.asarray(drawn)  # a draft has no planes
                else:
                    yield number, one

    def measured(self, number: int, image: np.ndarray) -> dict[str, float]:
        """Opening and width of the lips in an image (H, W, 3) of a frame, in eye distances.

        Those of the person whose line it is; nothing beside lines, and where no face is found.
        """
        from dubbing.face.finding.face_finder import region_of
        from dubbing.face.mouth.lip_measures import lip_lengths
        from dubbing.preparation.tracking import cropping

        cue = next((cue for cue in self.cues if cue.first <= number < cue.stop), None)
        if cue is None:
            return {}
        clip, pose = self.half.clips[cue.identity], int(self.half.poses[number])
        self.finder.follow_on([region_of(clip.landmarks[pose])])
        faces = self.finder.follow(cropping.crop(image, clip.crop[pose], clip.size))
        if not faces:
            return {}
        alone = {
            name: getattr(clip, name)[[pose]] for name in ("rotation", "translation", "centre")
        }
        one = replace(clip, landmarks=faces[0][None, :, :2] - 0.5, **alone)
        lengths = zip(LENGTHS, lip_lengths(one.frontal_landmarks())[0], strict=True)
        return {name: round(float(length), 4) for name, length in lengths if name in DRAWN}

    def heard(self, edits: Mapping[str, Edit]) -> dict[str, dict[str, Any]]:
        """By cue: opening and width of the lips in its frames, by style, and of a closed mouth.

        In eye distances; nothing of models without lip measures.
        """
        return {cue.name: self._heard(cue, edits.get(cue.name, Edit())) for cue in self.cues}

    def _heard(self, cue: Cue, edit: Edit) -> dict[str, Any]:
        import numpy as np

        lips = {style: self.half.lips(cue, replace(edit, style=style)) for style in STYLES}
        heard = {style: own for style, own in lips.items() if own is not None}
        if not heard:
            return {}
        closed = self.half.lips(cue, Edit(), np.zeros(len(heard[AS_SPOKEN]), np.float32))
        assert closed is not None
        return {
            name: {style: own[:, k].round(4).tolist() for style, own in heard.items()}
            | {"closed": round(float(closed[0, k]), 4)}
            for k, name in enumerate(LENGTHS)
            if name in DRAWN
        }


def blocks(numbers: list[int]) -> Iterator[tuple[int, int]]:
    """Runs first .. stop of numbers, short ones first: what is rendered at once comes at once."""
    size, place = FIRST_BLOCK, 0
    while place < len(numbers):
        stop, most = place + 1, min(place + size, len(numbers))
        while stop < most and numbers[stop] == numbers[stop - 1] + 1:
            stop += 1
        yield numbers[place], numbers[stop - 1] + 1
        place, size = stop, min(2 * size, LONGEST_BLOCK)


def of_video(video: Path, first: int, stop: int, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """Frames of the finished video, as large as those of the draft."""
    import cv2

    from dubbing.media import read_frames

    for image in read_frames(video, start=first, count=stop - first):
        yield cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def as_jpeg(image: np.ndarray) -> bytes:
    """An image (H, W, 3) uint8 RGB as a file."""
    import cv2

    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return data.tobytes()


def of_jpeg(data: bytes) -> np.ndarray:
    """The image (H, W, 3) uint8 RGB in a file."""
    import cv2
    import numpy as np

    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image[..., ::-1]
