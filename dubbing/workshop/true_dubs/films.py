"""Films of the scenes, their truth, and the manifest that dubs them.

    python -m dubbing.workshop.true_dubs.films OUT [--only NAME ...]

Nothing is made again that is there. `dfrf dub OUT/true_dubs.yaml` then makes the dubs.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import soundfile
from tqdm import tqdm

from dubbing import packages
from dubbing.engine.disk.files import atomic_path, atomic_write_text
from dubbing.errors import ExplainedError
from dubbing.media import VideoWriter, mux
from dubbing.workshop.true_dubs.camera_look import CameraLook
from dubbing.workshop.true_dubs.objects import Cover, hand, microphone, passed_by
from dubbing.workshop.true_dubs.rendered import FRAME_RATE, Rendered, rendered, speech
from dubbing.workshop.true_dubs.scenes import DUBBED, FRAMES, LEARNED, RATE, SCENES, Scene

MANIFEST = "true_dubs.yaml"
FILM, TRUE_FILM, COVER, TRUTH = "film.mkv", "true.mkv", "cover.mkv", "true_mouths.npz"
FIRST = round(LEARNED * RATE)  # frame at which the dubbed part begins
STAYS_FOR = "bruno"  # the face of who passes by


def covers(scene: Scene, mouths: np.ndarray) -> Iterator[Cover | None]:
    """The object in front of the face in each frame."""
    still = microphone(mouths[FIRST:, 0].mean(0), scene.size)
    for t in range(FRAMES):
        seen = t >= FIRST
        if scene.before == "hand" and seen:
            yield hand(t, mouths[t, 0], scene.size)
        elif scene.before == "microphone" and seen:
            yield still
        else:
            yield None


def frames(scene: Scene, film: Rendered, mouths: np.ndarray, folder: Path) -> Iterator[np.ndarray]:
    """Frames of a film as the camera records them."""
    look = CameraLook(scene.look, scene.size)
    others: Iterator[tuple[np.ndarray, np.ndarray] | None] = iter([None] * FRAMES)
    if scene.before == "passer-by":
        others = iter(rendered(Scene("", face=STAYS_FOR, size=scene.size), "a", folder).frames())
    before = zip(film.frames(), covers(scene, mouths), others, strict=True)
    for t, ((image, person), cover, other) in enumerate(before):
        whole = image if cover is None else cover.over(image)
        if other is not None and t >= FIRST:
            whole = passed_by(whole, person, other, t)
        yield look.picture(whole, t)


def write(scene: Scene, out: Path) -> None:
    """Write the films of a scene: what is dubbed, the true dub, what covers the face, the truth."""
    folder = out / scene.name
    if (folder / TRUTH).exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    renderings = out / "renderings"
    films = {name: rendered(scene, name, renderings) for name in ("a", "b")}
    mouths = films["a"].mouths
    look = CameraLook(scene.look, scene.size)
    _, side = look.transform(0)
    learned, said, wanted = (speech(name) for name in ("learned", "a", "b"))
    with tempfile.TemporaryDirectory(dir=folder) as temporary:
        silent, sound = Path(temporary, "silent.mkv"), Path(temporary, "sound.wav")
        with VideoWriter(silent, side, side, FRAME_RATE, "ffv1") as video:
            for image in frames(scene, films["a"], mouths, renderings):
                video.write(image)
        soundfile.write(sound, np.concatenate([learned.sound, said.sound]), said.rate)
        mux(
            silent,
            sound,
            folder / FILM,
            audio_start=0.0,
            seconds=LEARNED + DUBBED,
            audio_codec="flac",
        )
    with VideoWriter(folder / TRUE_FILM, side, side, FRAME_RATE, "ffv1") as video:
        for t, image in enumerate(frames(scene, films["b"], mouths, renderings)):
            if t >= FIRST:
                video.write(image)
    if scene.before in ("hand", "microphone"):
        with VideoWriter(folder / COVER, side, side, FRAME_RATE, "ffv1-gray") as video:
            for t, cover in enumerate(covers(scene, mouths)):
                if t >= FIRST and cover is not None:
                    matte = look.framed(cover.opacity.astype(np.float32), t)
                    video.write((matte * 255).round().astype(np.uint8))
    with atomic_path(folder / "b.wav") as temporary_sound:
        soundfile.write(temporary_sound, wanted.sound, wanted.rate, format="WAV")
    scale = np.stack([look.transform(t)[0][:, :2].diagonal() for t in range(FRAMES)])
    boxes = np.stack([look.points(mouths[t, 0], t) for t in range(FRAMES)])
    with atomic_path(folder / TRUTH) as temporary_truth, temporary_truth.open("wb") as file:
        np.savez(
            file,
            mouths=np.stack([boxes, mouths[:, 1] * scale], 1),
            film_opening=films["a"].opening,
            opening=films["b"].opening[FIRST:],
        )


def manifest(scenes: Sequence[Scene]) -> str:
    """The manifest of the dubs, YAML (JSON is YAML)."""
    consent = {"by": "Nobody Filmed", "reference": "a computed speaker"}
    people = {
        s.name: {"clip": f"{s.name}/{FILM}", "seconds": LEARNED, "consent": consent} for s in scenes
    }
    dubs = [
        {
            "name": s.name,
            "identity": s.name,
            "audio": f"{s.name}/b.wav",
            "video_start": LEARNED,
            "codec": "ffv1",
            "label": False,
            "mark": False,
        }
        for s in scenes
    ]
    whole = {"version": 1, "output": "dubs", "identities": people, "dubs": dubs}
    return json.dumps(whole, indent=1) + "\n"


def chosen(only: Sequence[str]) -> list[Scene]:
    """The scenes that names or patterns name; all where none is given.

    Raises:
        ExplainedError: a pattern names none.
    """
    for pattern in only:
        if not any(fnmatchcase(scene.name, pattern) for scene in SCENES):
            names = ", ".join(scene.name for scene in SCENES)
            raise ExplainedError(f"no scene is called {pattern}", "--only", f"there is {names}")
    return [s for s in SCENES if not only or any(fnmatchcase(s.name, p) for p in only)]


def parser(program: str, about: str | None) -> argparse.ArgumentParser:
    """The arguments of a program that works on scenes."""
    made = argparse.ArgumentParser(
        prog=f"python -m dubbing.workshop.true_dubs.{program}", description=about
    )
    made.formatter_class = argparse.RawDescriptionHelpFormatter
    made.add_argument("out", type=Path)
    made.add_argument("--only", nargs="*", default=[], help="names of scenes, or patterns")
    return made


def main() -> int:
    call = parser("films", __doc__).parse_args()
    try:
        packages.require_renderer()
        scenes = chosen(call.only)
        for scene in tqdm(scenes, desc="films"):
            write(scene, call.out)
        atomic_write_text(call.out / MANIFEST, manifest(scenes))
    except ExplainedError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
