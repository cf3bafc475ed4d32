"""The demo: a clip of a synthetic speaker, new speech for it, and the manifests that dub it."""

import shutil
import sysconfig
from pathlib import Path

import numpy as np
from tqdm import tqdm

from dubbing import packages
from dubbing.engine.disk.files import atomic_path

CLONED = Path(__file__).parents[3] / "manifests"
INSTALLED = Path(sysconfig.get_path("data"), "share", "dfrf", "manifests")
MANIFESTS = CLONED if (CLONED / "demo.yaml").is_file() else INSTALLED
SCRIPT = (
    "Hello. My name is Alba, and nobody filmed me: every pixel of this clip was computed. "
    "I move my lips and blink, so that a program can learn how I speak. "
    "Most people pause before a big promise. "
)
FILM_SECONDS = 2
VOICE = "en-us+f3"
DUBS = {
    "italian": ("it+f3", "Buongiorno! Adesso parlo italiano, e la mia bocca segue le parole."),
    "german": ("de+f2", "Guten Abend! Jetzt spreche ich Deutsch, und mein Mund bewegt sich mit."),
}


def write_demo(folder: Path, size: int = 320) -> Path:
    """Write the manifests into a folder, and what they name into FOLDER/source.

    Nothing is made again that is already there.

    Args:
        size: side of the frame, px.

    Returns:
        The manifest to dub.

    Raises:
        ExplainedError: the speaker cannot be made, or the folder cannot be written.
    """
    from dubbing.workshop.synthetic.speaker import make_speaker
    from dubbing.workshop.synthetic.voice import speak

    source = folder / "source"
    source.mkdir(parents=True, exist_ok=True)
    for template in sorted(MANIFESTS.iterdir()):
        if not (folder / template.name).exists():
            with atomic_path(folder / template.name) as temporary:
                shutil.copyfile(template, temporary)
    for name, (voice, text) in DUBS.items():
        if not (source / f"{name}.wav").exists():
            speak(text, voice, source / f"{name}.wav")
    # The truth is written last, so a clip beside it is whole.
    if not (source / "truth.npz").exists():
        with tqdm(total=100, desc="synthetic speaker", unit="%") as bar:
            make_speaker(
                source,
                text=SCRIPT,
                size=size,
                face="alba",
                voice=VOICE,
                progress=lambda _, done: bar.update(round(100 * done) - bar.n),
            )
    if not packages.missing_of("film"):
        write_film(source / "clip.mp4", source / "film")
    return folder / "demo.yaml"


def write_film(clip: Path, folder: Path) -> None:
    """The first seconds of a clip as EXR in ACEScg, with timecode: a film of image files."""
    import OpenImageIO

    from dubbing.media import probe, read_frames
    from dubbing.media.properties.film_values import FilmValues
    from dubbing.media.sequences import image_files, sequence

    values, rate = FilmValues("ACEScg"), probe(clip).rate
    for number, picture in enumerate(read_frames(clip, count=round(FILM_SECONDS * rate)), 1001):
        path = folder / f"alba.{number}.exr"
        if path.exists():
            continue
        height, width, _ = picture.shape
        header = OpenImageIO.ImageSpec(width, height, 3, "half")
        header.attribute("framesPerSecond", "rational", (rate.numerator, rate.denominator))
        header.attribute("chromaticities", "float[8]", sequence.CHROMATICITIES["lin_ap1_scene"])
        shown = picture.astype(np.float32) / 255
        image_files.write_image(path, values.of_display(shown), header)
