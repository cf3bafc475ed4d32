"""Makes clips of many people, for training: person000/ ... person007/.

    python -m dubbing.workshop.synthetic OUT --identities 8

Nothing is made again that is already there.
"""

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from dubbing import packages
from dubbing.errors import ExplainedError

VOICES = ("en-us", "en-us+f2", "en-gb-x-rp+m3", "en-us+f4", "en-gb-scotland+f3", "en-us+m7")


def identities(out: Path, count: int, size: int, seconds: float) -> None:
    """Clips of `count` different people: out/person000/clip.mp4 and so on."""
    from dubbing.workshop.synthetic.anatomy.face import random_face
    from dubbing.workshop.synthetic.speaker import TEXTS, make_speaker

    for i in tqdm(range(count), desc="synthetic people"):
        folder = out / f"person{i:03d}"
        if not (folder / "truth.npz").exists():
            texts = " ".join(TEXTS[(i + k) % len(TEXTS)] for k in range(3))
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
    parser = argparse.ArgumentParser(
        prog="python -m dubbing.workshop.synthetic", description=__doc__
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=320, help="side of the frame in px")
    parser.add_argument("--identities", type=int, required=True, help="how many people")
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each clip")
    call = parser.parse_args()
    try:
        packages.require_renderer()  # before anything of it is imported
        identities(call.out, call.identities, call.size, call.seconds)
    except ExplainedError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
