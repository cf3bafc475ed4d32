"""Properties of a media file: size after rotation, exact rate, frames, audio."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from dubbing.engine.disk.numbered import plain
from dubbing.errors import MediaError
from dubbing.media.properties.colour import Colour
from dubbing.media.properties.film_values import AS_SHOWN, FilmValues
from dubbing.media.properties.native import YUV420, PixelFormat
from dubbing.script.timecode import frame_of, nominal, timecode_of


@dataclass(frozen=True)
class Picture:
    """The picture of a video.

    Attributes:
        width, height: displayed pixels, after rotation and with square pixels.
        square: whether its pixels are square.
        pixels: the planar format that holds its values.
        dynamic: what its first frame has of dynamic metadata, in words; it is not kept.
    """

    width: int
    height: int
    colour: Colour
    square: bool = True
    pixels: PixelFormat = YUV420
    dynamic: tuple[str, ...] = ()


@dataclass(frozen=True)
class MediaInfo:
    """A media file. Without a picture, width and frames are 0.

    Attributes:
        width, height: as in `Picture`.
        frame_rate: frames a second; a constant one for a video of variable rate. See `rate`.
        frames: how many frames ``read_frames`` gives at that rate.
        duration: of the picture in seconds; of the audio, where there is no picture.
        audio_tracks: indices of the audio tracks that are read; see `tracks.heard_tracks`.
        unheard_tracks: number of the other tracks.
        unseen_tracks: number of video tracks beside the first, which is read.
        audio_channels: of all tracks that are read.
        centre: index of the centre channel of 3.0, 5.1 and the like; None if the file has none, or
            does not say.
        video_start, audio_start: seconds after the start of the file; 0 for most files.
        peak: the largest sample, 1 is full scale; 0 where samples are whole numbers, which have no
            larger ones.
        zero: time stamp of the start of the file in seconds.
        late: seconds after which ffmpeg's decoder gives the first frame of an AVI, which has no
            times of display. All of them are late by that.
        primed: whether its sound may be late by the silence that an encoder begins with (AAC: from
            21 ms on): an AVI does not say how much that is, nor AAC by itself.
        timecode: of the first frame, as ``01:00:00:00``; '' where the file has none.
        timecode_count: timecodes a second, where they are not those of the frame rate: high rates
            often have half of them.
        picture: of the first frame; None without a picture.
        values: the colour space of its picture, and that of what is shown of it.
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
    zero: float = 0.0
    late: float = 0.0
    primed: bool = False
    timecode: str = ""
    timecode_count: int | None = None
    audio_tracks: tuple[int, ...] = (0,)
    unheard_tracks: int = 0
    unseen_tracks: int = 0
    centre: int | None = None
    peak: float = 0.0
    values: FilmValues = AS_SHOWN

    @property
    def name(self) -> str:
        """Of the file, as a manifest writes it."""
        return plain(self.path).name

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
        """The colour space of its picture."""
        return self.picture.colour if self.picture else Colour()

    @property
    def pixels(self) -> PixelFormat:
        """The planar format that holds the values of its picture."""
        return self.picture.pixels if self.picture else YUV420

    @property
    def timecode_rate(self) -> Fraction:
        """Timecodes a second: the frame rate, or a part or a multiple of it."""
        if self.timecode_count is None:
            return self.rate
        return self.rate * Fraction(self.timecode_count, nominal(self.rate))

    @property
    def first_frame(self) -> int:
        """The frame number of its first timecode; 0 without one."""
        if not self.timecode:
            return 0
        return int(frame_of(self.timecode, self.timecode_rate) * self.rate / self.timecode_rate)

    def timecode_at(self, frame: int) -> str:
        """The timecode of a frame; counted from zero where the file has none."""
        number = int((self.first_frame + frame) * self.timecode_rate / self.rate)
        return timecode_of(number, self.timecode_rate, drop=self.drops)

    def full_timecode_at(self, frame: int) -> str:
        """The same with a number for every frame, as ffmpeg writes it; '' without a timecode."""
        if not self.timecode:
            return ""
        return timecode_of(self.first_frame + frame, self.rate, drop=self.drops)

    @property
    def drops(self) -> bool:
        """Whether its timecode is drop-frame."""
        return ";" in self.timecode

    @property
    def sound_seconds(self) -> float:
        """Seconds from the start of the file to the end of its audio; 0 without audio."""
        return self.audio_start + self.audio_duration if self.audio_duration else 0.0
