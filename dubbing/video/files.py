"""Files in the folder of a finished video."""

from pathlib import Path

from dubbing.media import SUFFIX

# The outcome of faces, the proof that a scene left the film alone, and a copy for browsers.
PICTURE_FILE, SCENE_FILE, PROXY_FILE = "picture.json", "scene.json", "proxy.mp4"
DELIVERED = "delivered"  # folder of frames that are delivered beside it


def video_file(folder: Path, codec: str) -> Path:
    """The finished video in a folder."""
    return folder / f"video{SUFFIX[codec]}"
