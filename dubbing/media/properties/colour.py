"""Colour spaces of video, by ffmpeg's names."""

from dataclasses import dataclass

import av

MATRICES = {1: "bt709", 5: "bt601", 6: "bt601", 9: "bt2020", 10: "bt2020"}
PRIMARIES = {
    **{1: "bt709", 4: "bt470m", 5: "bt470bg", 6: "smpte170m", 7: "smpte240m"},
    **{9: "bt2020", 11: "smpte431", 12: "smpte432"},
}
TRANSFERS = {
    **{1: "bt709", 4: "gamma22", 5: "gamma28", 6: "smpte170m", 7: "smpte240m", 8: "linear"},
    **{13: "iec61966-2-1", 14: "bt2020-10", 15: "bt2020-12", 16: "smpte2084"},
    18: "arib-std-b67",
}
# Primaries and transfer where a file names none, by its matrix; and names of the matrix in files.
DEFAULTS = {
    "bt709": ("bt709", "bt709"),
    "bt601": ("smpte170m", "smpte170m"),
    "bt2020": ("bt2020", "bt2020-10"),
}
TAGS = {"bt709": "bt709", "bt601": "smpte170m", "bt2020": "bt2020nc"}
RGB, FULL = 0, 2  # AVCOL_SPC_RGB, AVCOL_RANGE_JPEG
HIGH_RANGE = {"smpte2084": "PQ", "arib-std-b67": "HLG"}


@dataclass(frozen=True)
class Colour:
    """Matrix, primaries, transfer, and whether levels go from 0 to 255 instead of 16 to 235."""

    matrix: str = "bt709"
    primaries: str = "bt709"
    transfer: str = "bt709"
    full_range: bool = False

    @property
    def high_range(self) -> str:
        """PQ or HLG; '' without HDR."""
        return HIGH_RANGE.get(self.transfer, "")

    def tags(self) -> dict[str, str]:
        """Arguments of the filter setparams: encoders write the properties of frames."""
        return {
            "colorspace": TAGS[self.matrix],
            "color_primaries": self.primaries,
            "color_trc": self.transfer,
            "range": "pc" if self.full_range else "tv",
        }


def colour_of(frame: av.VideoFrame) -> Colour:
    """The colour space of a decoded frame; guessed from its size where it is not tagged."""
    larger = max(frame.width, frame.height) >= 1280 or int(frame.colorspace) == RGB
    matrix = MATRICES.get(int(frame.colorspace), "bt709" if larger else "bt601")
    primaries, transfer = DEFAULTS[matrix]
    return Colour(
        matrix,
        PRIMARIES.get(int(frame.color_primaries), primaries),
        TRANSFERS.get(int(frame.color_trc), transfer),
        int(frame.color_range) == FULL and int(frame.colorspace) != RGB,
    )
