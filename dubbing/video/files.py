"""Files in the folder of a finished video."""

from pathlib import Path

from dubbing.engine.disk.numbered import numbered, options_of
from dubbing.media import SUFFIX

# The outcome of faces, the proof that a scene left the film alone, and a copy for browsers.
PICTURE_FILE, SCENE_FILE, PROXY_FILE = "picture.json", "scene.json", "proxy.mp4"
DELIVERED = "delivered"  # folder of frames that are delivered beside it


def video_file(folder: Path, codec: str) -> Path:
    """The finished video in a folder."""
    return folder / f"video{SUFFIX[codec]}"


def options_of_video(film: Path, frame: str) -> dict[str, str]:
    """How a finished video is read: as its film, where it has the film's own values.

    Args:
        frame: see `VideoSettings`.
    """
    return {} if numbered(film) or frame == "crop" else options_of(film)
