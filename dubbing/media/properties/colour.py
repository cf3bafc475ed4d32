"""Colour spaces of video, by ffmpeg's names."""

from dataclasses import dataclass
from struct import Struct
from typing import Any

import av

MATRICES = {1: "bt709", 5: "bt601", 6: "bt601", 9: "bt2020"}
# What ffmpeg makes no RGB of: matrices, and transfers.
UNREAD = {
    **{8: "YCgCo", 10: "BT.2020 of constant luminance", 11: "SMPTE 2085", 14: "ICtCp", 15: "IPT"},
    **dict.fromkeys((12, 13), "a matrix derived from its primaries"),
    **dict.fromkeys((16, 17), "YCgCo-R"),
}
LOGARITHMIC = (9, 10)
PRIMARIES = {
    **{1: "bt709", 4: "bt470m", 5: "bt470bg", 6: "smpte170m", 7: "smpte240m"},
    **{8: "film", 9: "bt2020", 10: "smpte428", 11: "smpte431", 12: "smpte432"},
}
TRANSFERS = {
    **{1: "bt709", 4: "bt470m", 5: "bt470bg", 6: "smpte170m", 7: "smpte240m", 8: "linear"},
    **{11: "iec61966-2-4", 12: "bt1361e", 13: "iec61966-2-1", 14: "bt2020-10", 15: "bt2020-12"},
    **{16: "smpte2084", 17: "smpte428", 18: "arib-std-b67"},
}
# Primaries and transfer where a file names none, by its matrix; and names of the matrix in files.
DEFAULTS = {
    "bt709": ("bt709", "bt709"),
    "bt601": ("smpte170m", "smpte170m"),
    "bt2020": ("bt2020", "bt2020-10"),
}
TAGS = {"bt709": "bt709", "bt601": "smpte170m", "bt2020": "bt2020nc"}
# Rationals of x and y of red, green, blue and white, lowest and highest luminance, what is given.
MASTERING, LIGHT = Struct("<22i"), Struct("<2I")
RGB, FULL = 0, 2  # AVCOL_SPC_RGB, AVCOL_RANGE_JPEG
PAL, PAL_LINES = 5, 576  # AVCOL_SPC_BT470BG, and as primaries
# Colour spaces of OpenColorIO by transfer and primaries.
SPACES = {
    ("smpte2084", "smpte432"): "ST2084-P3-D65 - Display",
    ("smpte2084", ""): "Rec.2100-PQ - Display",
    ("arib-std-b67", ""): "Rec.2100-HLG - Display",
}
DYNAMIC = {
    "DYNAMIC_HDR_PLUS": "HDR10+",
    "DYNAMIC_HDR_VIVID": "HDR Vivid",
    "DOVI_RPU_BUFFER": "Dolby Vision",
    "DOVI_METADATA": "Dolby Vision",
    "AMBIENT_VIEWING_ENVIRONMENT": "ambient light",
}
CHROMATICITY, LUMINANCE = 50000, 10000  # steps of mastering display metadata, a unit and cd/m2


@dataclass(frozen=True)
class Colour:
    """Matrix, primaries, transfer, and whether levels go from 0 to 255 instead of 16 to 235.

    Attributes:
        mastering, light: static metadata of HDR, as ffmpeg's options of these; '' without any.
    """

    matrix: str = "bt709"
    primaries: str = "bt709"
    transfer: str = "bt709"
    full_range: bool = False
    mastering: str = ""
    light: str = ""

    @property
    def space(self) -> str:
        """OpenColorIO's name of the colour space of HDR; '' without HDR."""
        exact = SPACES.get((self.transfer, self.primaries))
        return exact or SPACES.get((self.transfer, ""), "")

    def static(self) -> dict[str, str]:
        """Options of ffmpeg's input that give frames the static metadata."""
        both = {"mastering_display": self.mastering, "content_light": self.light}
        return {option: text for option, text in both.items() if text}

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
    if matrix == "bt601" and (int(frame.colorspace) == PAL or frame.height == PAL_LINES):
        primaries = PRIMARIES[PAL]
    static = _side_data(frame)
    return Colour(
        matrix,
        PRIMARIES.get(int(frame.color_primaries), primaries),
        TRANSFERS.get(int(frame.color_trc), transfer),
        int(frame.color_range) == FULL and int(frame.colorspace) != RGB,
        _mastering(static.get("MASTERING_DISPLAY_METADATA", b"")),
        _light(static.get("CONTENT_LIGHT_LEVEL", b"")),
    )


def unread(frame: av.VideoFrame) -> str:
    """What a decoded frame says of its colours that cannot be read, in words; '' else."""
    logarithmic = "a logarithmic transfer" if int(frame.color_trc) in LOGARITHMIC else ""
    return UNREAD.get(int(frame.colorspace), logarithmic)


def dynamic_metadata(frame: av.VideoFrame) -> tuple[str, ...]:
    """Metadata of a decoded frame that changes from scene to scene, or with the room."""
    return tuple(dict.fromkeys(DYNAMIC[name] for name in _side_data(frame) if name in DYNAMIC))


def _side_data(frame: av.VideoFrame) -> dict[str, bytes]:
    found: Any = frame.side_data  # PyAV's stubs have another type
    return {one.type.name: bytes(one) for one in found}


def _mastering(data: bytes) -> str:
    """Of an AVMasteringDisplayMetadata; '' where it lacks primaries or luminance."""
    if len(data) < MASTERING.size or not all((found := MASTERING.unpack_from(data))[-2:]):
        return ""
    red, green, blue, white = (
        ",".join(f"{round(CHROMATICITY * found[k] / found[k + 1])}" for k in (at, at + 2))
        for at in range(0, 16, 4)
    )
    low, high = (round(LUMINANCE * found[k] / found[k + 1]) for k in (16, 18))
    return f"G({green})B({blue})R({red})WP({white})L({high},{low})"


def _light(data: bytes) -> str:
    return ",".join(map(str, LIGHT.unpack_from(data))) if len(data) >= LIGHT.size else ""
