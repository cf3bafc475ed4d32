"""Makes the clip and the recordings that manifests/demo.yaml dubs, or clips of many people.

    python -m dubbing.synthetic OUT                    clip.mp4, italian.wav, german.wav
    python -m dubbing.synthetic OUT --identities 8     person000/ ... person007/, for training

Nothing is made again that is already there.
"""

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from dubbing import packages
from dubbing.errors import DubbingError

SCRIPT = (
    "Hello. My name is Alba, and nobody filmed me: every pixel of this clip was computed. "
    "I move my lips and blink, so that a program can learn how I speak. "
    "Most people pause before a big promise. "
)
VOICE = "en-us+f3"
DUBS = {
    "italian": ("it+f3", "Buongiorno! Adesso parlo italiano, e la mia bocca segue le parole."),
    "german": ("de+f2", "Guten Abend! Jetzt spreche ich Deutsch, und mein Mund bewegt sich mit."),
}
TRAINING_TEXTS = (
    "The boat below the bridge moved slowly up the river, while five boys waved from the bank. "
    "We have been warm and dry all week; how was your weather?",
    "Please bring me a map, some bread, and a pound of plums. Thank you very much. "
    "She sells fresh fish from a shop by the shore, whatever the wind may do.",
    "Why would anyone borrow a blue umbrella on a bright day in May? "
    "My father thought about it, shook his head, and put both of them back.",
)
VOICES = ("en-us", "en-us+f2", "en-gb-x-rp+m3", "en-us+f4", "en-gb-scotland+f3", "en-us+m7")


def demo(out: Path, size: int) -> None:
    """The clip (out/clip.mp4) and the new speech (out/italian.wav, out/german.wav)."""
    from dubbing.synthetic.speaker import make_speaker
    from dubbing.synthetic.voice import speak

    for name, (voice, text) in DUBS.items():
        if not (out / f"{name}.wav").exists():
            speak(text, voice, out / f"{name}.wav")
    # The truth is written last, so a clip beside it is whole.
    if not (out / "truth.npz").exists():
        with tqdm(total=100, desc="synthetic speaker", unit="%") as bar:
            make_speaker(
                out,
                text=SCRIPT,
                size=size,
                face="alba",
                voice=VOICE,
                progress=lambda _, done: bar.update(round(100 * done) - bar.n),
            )


def identities(out: Path, count: int, size: int, seconds: float) -> None:
    """Clips of `count` different people: out/person000/clip.mp4 and so on."""
    from dubbing.synthetic.anatomy.face import random_face
    from dubbing.synthetic.speaker import make_speaker

    for i in tqdm(range(count), desc="synthetic people"):
        folder = out / f"person{i:03d}"
        if not (folder / "truth.npz").exists():
            texts = " ".join(TRAINING_TEXTS[(i + k) % len(TRAINING_TEXTS)] for k in range(3))
            make_speaker(
                folder,
                text=texts,
                seconds=seconds,
                size=size,
                face=random_face(i),
                voice=VOICES[i % len(VOICES)],
                seed=i,
            )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m dubbing.synthetic", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=320, help="side of the picture in px")
    parser.add_argument("--identities", type=int, default=0, help="make N people instead")
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each of the N clips")
    call = parser.parse_args()
    try:
        packages.require("synthetic")  # before anything of it is imported
        if call.identities:
            identities(call.out, call.identities, call.size, call.seconds)
        else:
            demo(call.out, call.size)
    except DubbingError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
