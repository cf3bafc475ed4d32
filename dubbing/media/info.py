"""What a media file holds: size after rotation, exact rate, frames, sound."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from dubbing.errors import MediaError
from dubbing.media.colour import Colour
from dubbing.script.timecode import frame_of, timecode_of


@dataclass(frozen=True)
class Picture:
    """The picture of a clip.

    Attributes:
        width, height: displayed pixels, after rotation and with square pixels.
        interlaced: whether a frame holds two fields.
        square: whether its pixels are square.
        bits: of each colour channel.
    """

    width: int
    height: int
    colour: Colour
    interlaced: bool = False
    square: bool = True
    bits: int = 8


@dataclass(frozen=True)
class MediaInfo:
    """A media file. Without a picture, width and frames are 0.

    Attributes:
        width, height: as in `Picture`.
        frame_rate: frames a second; a constant one for a clip of variable rate. See `rate`.
        frames: how many frames ``read_frames`` gives at that rate.
        duration: of the picture in seconds; of the sound, where there is no picture.
        video_start, audio_start: seconds after the start of the file; 0 for most files.
        zero: time stamp of the start of the file in seconds, where ffmpeg would count from the
            first requested stream instead (MPEG-TS, MPEG-PS, Ogg); else None.
        timecode: of the first frame, as ``01:00:00:00``; '' where the file has none.
        picture: of the first frame; None without a picture.
    """

    path: Path
    width: int
    height: int
    frame_rate: Fraction | None
    frames: int
    duration: float
    variable_rate: bool
    video_start: float
    picture: Picture | None
    audio_rate: int | None
    audio_channels: int | None
    audio_duration: float | None
    audio_start: float
    zero: float | None = None
    timecode: str = ""

    @property
    def rate(self) -> Fraction:
        """Frames a second.

        Raises:
            MediaError: there is no picture.
        """
        if self.frame_rate is None:
            raise MediaError("no picture in it", str(self.path), "give a video")
        return self.frame_rate

    @property
    def colour(self) -> Colour:
        """The colours of its picture."""
        return self.picture.colour if self.picture else Colour()

    @property
    def first_frame(self) -> int:
        """The frame that its timecode begins with; 0 without one."""
        return frame_of(self.timecode, self.rate) if self.timecode else 0

    def timecode_at(self, frame: int) -> str:
        """The timecode of a frame; counted from zero where the file has none."""
        return timecode_of(self.first_frame + frame, self.rate, drop=";" in self.timecode)

    @property
    def sound_seconds(self) -> float:
        """From the start of the file to the end of its sound; 0 without sound."""
        return self.audio_start + self.audio_duration if self.audio_duration else 0.0
