"""Compares the dubs of the scenes with their truth, and prints a table.

    python -m dubbing.workshop.true_dubs.measure OUT [--only NAME ...]

`OUT/figures.json` then holds the figures of every scene, and `OUT/NAME/tiles.png` shows the film,
the dub and the true dub above one another.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

from dubbing.engine.disk.files import atomic_path, atomic_write_json
from dubbing.errors import ExplainedError
from dubbing.face.mouth.mouth_reader import MouthReader, mouth_picture
from dubbing.media import read_frames
from dubbing.workshop.lab.metrics import lips
from dubbing.workshop.true_dubs.figures import DubFigures, mean_of
from dubbing.workshop.true_dubs.films import COVER, FILM, FIRST, TRUE_FILM, TRUTH, chosen, parser
from dubbing.workshop.true_dubs.scenes import FRAMES, RATE

FIGURES = "figures.json"
TILES, TILE = 6, 320  # so many frames, px
READABLE = 0.95  # correlation of what is read off the true dub with the truth
COLUMNS = {
    "dubbed": "dubbed",
    "psnr": "PSNR",
    "psnr_mouth": "mouth",
    "ssim_mouth": "SSIM",
    "lmd": "LMD",
    "opening_r": "opening r",
    "width_r": "width r",
    "closure_mcc": "closures",
    "opening_ratio": "opening",
    "texture_ratio": "texture",
    "seam": "seam",
    "chin": "chin",
    "old_chin": "old chin",
    "noise": "noise",
    "sharpness": "sharp",
    "covered_dubbed": "covered",
    "cover_changed": "changed",
}


def compared(out: Path, name: str) -> dict[str, float]:
    """The figures of one scene; leaves its tiles.

    Raises:
        ExplainedError: it was not dubbed.
    """
    folder, dub = out / name, out / "dubs" / f"{name}.mkv"
    if not dub.exists():
        raise ExplainedError("is not there", str(dub), f"run `dfrf dub {out}/true_dubs.yaml`")
    count = FRAMES - FIRST
    with np.load(folder / TRUTH) as known:
        mouths, film_opening, opening = (known[n] for n in ("mouths", "film_opening", "opening"))
    pictures = map(mouth_picture, read_frames(folder / FILM, count=FRAMES), mouths)
    reader = MouthReader(np.stack(list(pictures)), film_opening)
    mouths = mouths[FIRST:]
    mattes: Iterator[np.ndarray | None] = repeat(None)
    if (folder / COVER).exists():
        mattes = read_frames(folder / COVER, pixels="gray")
    figures = DubFigures(RATE)
    tiles, seen = [], []
    films = zip(
        read_frames(dub, count=count),
        read_frames(folder / FILM, start=FIRST, count=count),
        read_frames(folder / TRUE_FILM, count=count),
        mouths,
        mattes,
        strict=False,
    )
    shown = set(np.linspace(3, count - 4, TILES).round().astype(int).tolist())
    for t, (made, film, truth, mouth, matte) in enumerate(films):
        figures.add(made, film, truth, mouth, None if matte is None else matte / 255)
        seen.append([mouth_picture(x, mouth) for x in (made, truth)])
        if t in shown:
            tiles.append(np.concatenate([around(x, mouth) for x in (film, made, truth)]))
    with atomic_path(folder / "tiles.png") as temporary:
        image = cv2.cvtColor(np.concatenate(tiles, 1), cv2.COLOR_RGB2BGR)
        temporary.write_bytes(cv2.imencode(".png", image)[1].tobytes())
    dub_opening, true_opening = (reader.read(x) for x in np.stack(seen, 1))
    return figures.figures() | openings(dub_opening, true_opening, opening)


def openings(dub: np.ndarray, true_dub: np.ndarray, opening: np.ndarray) -> dict[str, float]:
    """How well openings (T,) that are read off a dub follow the true ones, in its true dub's stead.

    Empty where the picture of the true dub does not show them either.
    """
    if lips.correlation(true_dub, opening) < READABLE:
        return {}
    return {
        "opening_r": lips.correlation(dub, opening),
        "opening_ratio": lips.spread_ratio(dub, true_dub),
    }


def around(image: np.ndarray, mouth: np.ndarray) -> np.ndarray:
    """The lower face, enlarged, (TILE, TILE, 3)."""
    reach = 2.0 * float(mouth[1].max())
    scale = TILE / (2 * reach)
    shift = TILE / 2 - scale * mouth[0]
    matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    return np.asarray(cv2.warpAffine(image, matrix, (TILE, TILE), flags=cv2.INTER_CUBIC))


def table(figures: Mapping[str, Mapping[str, float]]) -> str:
    """A Markdown table of the scenes, one row each."""
    lines = ["| scene | " + " | ".join(COLUMNS.values()) + " |", "|---" * (len(COLUMNS) + 1) + "|"]
    for name, row in figures.items():
        cells = (cell(key, row.get(key)) for key in COLUMNS)
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def cell(key: str, value: float | None) -> str:
    """A figure as the table writes it."""
    if value is None:
        return ""
    if key in ("dubbed", "covered_dubbed", "cover_changed"):
        return f"{100 * value:.1f} %" if key == "cover_changed" else f"{100 * value:.0f} %"
    if key.startswith("psnr"):
        return f"{value:.1f}"
    return f"{value:.2f}"


def measure(out: Path, names: Sequence[str], jobs: int) -> dict[str, dict[str, float]]:
    """The figures of scenes, several side by side."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as workers:
        figures = dict(zip(names, workers.map(compared, repeat(out), names), strict=False))
    return figures


def main() -> int:
    arguments = parser("measure", __doc__)
    arguments.add_argument("--jobs", type=int, default=2, help="scenes at a time")
    call = arguments.parse_args()
    try:
        figures = measure(call.out, [scene.name for scene in chosen(call.only)], call.jobs)
    except ExplainedError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    atomic_write_json(call.out / FIGURES, figures)
    print(table({**figures, "mean": mean_of(figures.values())}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
