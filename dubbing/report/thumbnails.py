"""Small images of dubs, by which one finds them on the page."""

from contextlib import suppress
from pathlib import Path

from dubbing import media
from dubbing.engine.disk.files import atomic_write_bytes, make_folder
from dubbing.errors import ExplainedError

THUMBNAILS = "thumbnails"  # folder of images, in that of the stages
WIDTH, QUALITY = 320, 80


def thumbnail_of(video: Path, frame: int, work: Path) -> Path | None:
    """An image of a frame of a video below the folder of the stages; None of one that is damaged.

    It is made anew where the video is newer.
    """
    path = work / THUMBNAILS / f"{video.stem}.jpg"
    for _ in range(2):  # what fails once, as where memory runs out for a moment, is made again
        with suppress(ExplainedError, OSError):
            if not path.is_file() or path.stat().st_mtime < video.stat().st_mtime:
                make_folder(path.parent)
                atomic_write_bytes(path, _image(video, frame))
            return path
    return None


def _image(video: Path, frame: int) -> bytes:
    """As JPEG. Of a video that ends before that frame, the first one."""
    import cv2

    frames = [*media.read_frames(video, start=frame, count=1)]
    image = frames[0] if frames else next(iter(media.read_frames(video, count=1)))
    size = (WIDTH, max(1, round(WIDTH * image.shape[0] / image.shape[1])))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])
