"""Properties of the picture of a video, from its first frame."""

from pathlib import Path

import av

from dubbing.errors import MediaError
from dubbing.media.opening.opening import opened
from dubbing.media.properties.colour import colour_of, dynamic_metadata, unread
from dubbing.media.properties.info import Picture
from dubbing.media.properties.native import PixelFormat

SHORTEST, LONGEST, SLIMMEST = 16, 16384, 10  # px, px, and one side over the other
AVI = "avi"  # it has times of decoding alone: a frame for each, in their order


def picture_of(path: Path, video: av.video.stream.VideoStream) -> tuple[Picture, float]:
    """Properties of the picture, from the first frame.

    And by how many seconds decoded frames have their times late: see `MediaInfo.late`.

    Raises:
        MediaError: no frame can be decoded, or its shape is unusual.
    """
    try:
        with opened(path) as container:
            frame = next(container.decode(container.streams[video.index]), None)
    except av.InvalidDataError as error:
        what = "its first frames cannot be decoded, as where it begins between key frames"
        raise MediaError(what, str(path), "convert it to .mp4 or .mov") from error
    if not isinstance(frame, av.VideoFrame):
        raise MediaError("no frame of it can be decoded", str(path), "is the file complete?")
    if colours := unread(frame):
        what = f"its colours are tagged as {colours}, which cannot be read"
        raise MediaError(what, str(path), "convert it to BT.709, or correct its tags")
    width, height = frame.width, frame.height
    aspect = video.sample_aspect_ratio
    if aspect:
        width = round(width * aspect)
    if frame.rotation % 180:
        width, height = height, width
    sides = sorted((width, height))
    stored = min(frame.width, frame.height)
    if min(stored, sides[0]) < SHORTEST or sides[1] > min(LONGEST, SLIMMEST * sides[0]):
        what = f"its picture is {width}x{height} px as displayed"
        if (frame.width, frame.height) not in ((width, height), (height, width)):
            what += f", {frame.width}x{frame.height} px as stored"
        bounds = f"{SHORTEST} to {LONGEST} px a side, one at most {SLIMMEST} times the other"
        raise MediaError(what, str(path), f"use a video of {bounds}")
    waited = (frame.dts or 0) - (video.start_time or 0) if container.format.name == AVI else 0
    picture = Picture(
        width,
        height,
        colour_of(frame),
        square=not aspect or aspect == 1,
        pixels=PixelFormat.holding(frame.format.name),
        dynamic=dynamic_metadata(frame),
    )
    return picture, float(waited * (video.time_base or 0))
