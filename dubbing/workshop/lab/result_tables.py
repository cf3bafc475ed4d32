"""Tables of figures with their spread over seeds: a row a clip and method, a row of medians."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean, median, stdev
from typing import Any

from dubbing.workshop.lab.composition import CHANGES, SOURCES
from dubbing.workshop.lab.evaluation import Figures

# Title of a column, figure, digits behind the point.
MOUTH = (
    ("opening r", "opening_r", 3),
    ("width r", "width_r", 3),
    ("closures F1", "closure_f1_near", 3),
    ("MCC", "closure_mcc", 3),
)
P15 = (
    ("PSNR", "psnr", 2),
    ("SSIM", "ssim", 4),
    ("HaarPSI", "haarpsi", 3),
    ("LPIPS", "lpips", 4),
    ("face", "psnr_face", 2),
    ("mouth", "psnr_mouth", 2),
    ("LMD", "lmd", 2),
    *MOUTH,
    ("sharpness mouth", "sharpness_mouth", 2),
    ("eyes", "sharpness_eyes", 2),
    ("flicker", "flicker", 2),
    ("confidence", "confidence", 3),
    ("frames", "frames", 0),
    ("steps", "steps", 0),
)
P15X = (
    *MOUTH,
    ("opening ratio", "opening_ratio", 2),
    ("lag, ms", "lag_ms", 0),
    ("LMD", "lmd", 2),
    ("texture", "texture_ratio", 2),
    ("chin", "chin_ratio", 2),
    ("old chin", "old_chin_ratio", 2),
    ("confidence", "confidence", 3),
    ("source's", "source_confidence", 3),
)
SHARES = (
    *((f"replaced: {name}", f"replaced {name}", 3) for name in SOURCES),
    *((f"mouth: {name}", f"mouth {name}", 3) for name in SOURCES),
)
CHANGED = tuple((name, f"{name} changes dB", 1) for name in CHANGES)
Columns = tuple[tuple[str, str, int], ...]


def table(columns: Columns, runs: Sequence[Figures]) -> list[str]:
    """Lines of a table: a row a clip and method, and rows of the medians over clips.

    Args:
        runs: flat figures of each seed. One that fewer than two seeds have does not appear.
    """
    methods = list(dict.fromkeys(m for run in runs for found in run.values() for m in found))
    people = list(dict.fromkeys(name for run in runs for name in run))
    rows = []
    for method in methods:
        known = [name for name in people if any(method in run.get(name, {}) for run in runs)]
        measured = [[run.get(name, {}).get(method, {}) for run in runs] for name in known]
        for name, figures in zip(known, measured, strict=True):
            rows.append([f"`{name}`", method, *_cells(columns, figures)])
        if len(known) > 1:
            middle = [_medians(columns, results) for results in zip(*measured, strict=True)]
            rows.append([f"median of {len(known)}", method, *_cells(columns, middle)])
    filled = [k for k in range(2 + len(columns)) if any(row[k] for row in rows)]
    head = ["clip", "method", *(title for title, _, _ in columns)]
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(line[k] for k in filled) + " |" for line in lines]


def _medians(columns: Columns, results: Sequence[dict[str, Any]]) -> dict[str, float]:
    """The median over people of each figure that all of them have."""
    figures = [
        figure for _, figure, _ in columns if all(f.get(figure) is not None for f in results)
    ]
    return {figure: median(f[figure] for f in results) for figure in figures}


def _cells(columns: Columns, measured: Sequence[dict[str, Any]]) -> list[str]:
    """`mean ± standard deviation` over the seeds; counts that no seed changes stand alone."""
    cells = []
    for _, figure, digits in columns:
        values = [float(row[figure]) for row in measured if row.get(figure) is not None]
        counted = figure in ("frames", "steps") and len(set(values)) == 1
        spread = "" if counted or len(values) < 2 else f" ± {stdev(values):.{digits}f}"
        cells.append(f"{fmean(values):.{digits}f}{spread}" if len(values) > 1 else "")
    return cells
