"""Is a film one that can be dubbed: its pictures, its colour space, and what is made of it?"""

from collections.abc import Callable
from pathlib import Path

from dubbing.engine.disk.numbered import numbered, plain
from dubbing.errors import MediaError
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings, Scene
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.media import MediaInfo
from dubbing.media.probing.fields import is_flagged, looks_interlaced
from dubbing.media.properties.film_values import space_of


def of_options(findings: Findings, at: KeyPath, identity: Identity) -> None:
    """How clips are read: rate and colour spaces of those that they are for."""
    if identity.rate is not None and not identity.sequences:
        findings.add((*at, "rate"), "is for image sequences, and no clip is one; leave it out")
    if (colour := identity.colour) is None:
        return
    for key, name in colour.spaces.items():
        try:
            space_of(name)
        except MediaError as error:
            findings.add((*at, "colour", key), str(error))
    films = {plain(film) for film in identity.films}
    for k, clip in enumerate(colour.clips):
        if plain(clip) not in films:
            findings.add((*at, "colour", "clips", k), f"{plain(clip)} is no clip of {at[-1]}")


def of_picture(findings: Findings, name: str, info: MediaInfo, at: KeyPath) -> None:
    """Properties of a clip that results cannot keep: problems, or warnings if it looks right."""
    picture = info.picture
    assert picture is not None  # a clip has one
    file = info.name

    def warn(what: str) -> None:
        findings.warn(f"identities.{name}: {what}")

    if info.variable_rate:
        warn(f"{file} has a variable frame rate; it is read at {float(info.rate):g} a second")
    info.values.check()
    if info.colour.space:  # nothing in the manifest says so
        shown = info.values.working or "sRGB"
        warn(f"{file} is {info.values.film}; heads are rendered in {shown}, with 8 bits")
    if picture.dynamic:
        what = f"{', '.join(picture.dynamic)} of {file}"
        warn(f"{what} is not in the results; make it anew of them")
    if not numbered(info.path) and _seen(is_flagged, info):
        message = f"{plain(info.path)} is interlaced: its frames are two moments each"
        findings.add(at, f"{message}; deinterlace it first")
    elif _seen(looks_interlaced, info):
        what = f"{file} looks interlaced, though nothing in it says so"
        warn(f"{what}: deinterlace it first if moving edges are combs")
    if not picture.square:
        what = f"the pixels of {file} are not square; those of the results are"
        warn(f"{what}: {info.width}x{info.height}")
    if picture.pixels.bits > 8 and not info.values.film:
        what = f"{file} has {picture.pixels.bits} bits a colour"
        warn(f"{what}; heads are rendered with 8, and the codec h264 writes 8")


def _seen(what: Callable[[Path], bool], info: MediaInfo) -> bool:
    try:
        return what(info.path)
    except MediaError:
        return False  # decoding it later reports why


def of_codec(findings: Findings, at: KeyPath, dub: Dub, scene: Scene) -> None:
    """Check that a codec holds the film's own values."""
    film = findings.media[scene.clip]
    own = dub.frame == "full" and not numbered(scene.clip)
    if own and film.values.film and dub.codec == "h264":
        what = f"h264 has 8 bits, too few for {film.values.film} of {plain(scene.clip).name}"
        others = "hevc, prores, prores4444, dnxhr or ffv1"
        findings.add((*at, "codec"), f"{what}: choose {others}")


def of_delivery(findings: Findings, at: KeyPath, dub: Dub, scene: Scene) -> None:
    """Check that a film has frames of its own to deliver."""
    if dub.deliver == "video":
        return
    key = (*at, "deliver")
    if not numbered(scene.clip):
        findings.add(key, f"{plain(scene.clip).name} is no image sequence; leave it out")
    elif dub.frame == "crop":
        findings.add(key, "is of whole frames; leave frame out")
    elif scene.on_longer_audio not in ("cut", "fail") and (
        scene.length > findings.media[scene.clip].frames - scene.first
    ):
        message = "the speech is longer than the film, so frames would come twice"
        findings.add(key, f"{message}: set on_longer_audio to cut")
