"""A script for Nuke that lays a turnover over the film."""

from fractions import Fraction
from pathlib import Path

from dubbing.engine.disk.numbered import numbered
from dubbing.media.sequences.image_files import header_of

NUKE = """\
Root {{
 inputs 0
 first_frame {first}
 last_frame {last}
 fps {rate}
 format "{size}"
 project_directory "\\[python \\{{nuke.script_directory()\\}}]"
}}
Read {{
 inputs 0
 file "{layer}"
 first {first}
 last {last}
 on_error black
 raw true
 name Dub
}}
Read {{
 inputs 0
 file "{film}"
 first {first}
 last {last}
 raw true
 name Film
}}
Merge2 {{
 inputs 2
 operation over
 bbox B
 name DubOverFilm
}}
"""


def script(film: Path, rate: Fraction) -> str:
    """A script for Nuke: the turnover, from the folder of the script, over the film."""
    files = numbered(film)
    assert files is not None
    first, *_, last = [*files.files(), *files.files()]
    header = header_of(files.files()[first])
    width, height = header.full_width, header.full_height
    # Nuke takes the input that comes last for the one below.
    return NUKE.format(
        first=first,
        last=last,
        rate=f"{float(rate):.6g}",
        size=f"{width} {height} 0 0 {width} {height} 1 film",
        layer=f"{files.plain.stem}.exr",
        film=files.plain.as_posix(),
    )
