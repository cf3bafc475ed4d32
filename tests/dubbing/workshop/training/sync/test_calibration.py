"""The faults are those that they are called, and the fit finds the parts that show them."""

import numpy as np
import pytest

from dubbing.face.mouth.mouth_shape import mouth_shape, opening
from dubbing.sync.closeness import WEIGHTS, Closeness, number_of
from dubbing.sync.curves import early_ms
from dubbing.sync.network.sync_network import load_network
from dubbing.workshop.training.sync.calibration import (
    HALF,
    REAL,
    Calibration,
    Window,
    fit,
    logarithms,
    numbers,
    table,
)
from dubbing.workshop.training.sync.faults import Mouth, delayed, mouth_faults
from tests.dubbing.conftest import Speaker
from tests.dubbing.sync.made import made_crops
from tests.dubbing.sync.meshes import canonical, talk

GAP = 0.05 + 0.04 * np.sin(np.arange(100) / 3)
LOUDNESS = 60 + 10 * np.cos(np.arange(100) / 7)
MOUTH = Mouth(mouth_shape(talk(GAP), canonical()), made_crops(50 * GAP, np.full(100, 18.0)))
FAULTS = mouth_faults(MOUTH, LOUDNESS, 25.0)


def test_faults_of_a_mouth() -> None:
    gaps = {kind: opening(mouth.shapes) for kind, mouth in FAULTS.items()}
    assert gaps["frozen"].std() < 0.1 * GAP.std()
    assert gaps["half as strong"].std() == pytest.approx(0.5 * GAP.std(), rel=0.05)
    assert gaps["never closes"].min() > 0.03
    assert np.corrcoef(gaps["flaps with the loudness"], LOUDNESS)[0, 1] > 0.95
    assert np.array_equal(gaps["blurred, 0.2 widths"], opening(MOUTH.shapes))
    edges = [
        (np.diff(m.crops.astype(int)) ** 2).mean() for m in (MOUTH, FAULTS["blurred, 0.2 widths"])
    ]
    assert edges[1] < 0.7 * edges[0]


def test_closures_come_late_and_openings_do_not() -> None:
    shown = delayed(GAP, 3.0, 25.0)
    least, most = np.quantile(GAP, [0.2, 0.95])
    closed, opened = least > GAP, most < GAP
    assert (np.arange(100)[closed] - shown[closed])[2:].tolist() == [3] * (closed.sum() - 2)
    assert (np.arange(100)[opened] - shown[opened]).max() < 3


def made(kind: str, amount: int, **parts: float) -> list[Window]:
    """Windows of a person in turn, with a little noise in all parts."""
    rng = np.random.default_rng(0)
    found = []
    for k in range(amount):
        noisy = {
            p: parts.get(p, 0.95) * rng.uniform(0.9, 1) for p in WEIGHTS if p != "silence" or k % 2
        }
        found.append(Window("ab"[k % 2], kind, Closeness(number_of(noisy), noisy), "warn"))
    return found


def test_the_fit_weighs_the_parts_that_show_the_faults() -> None:
    windows = [*made(REAL, 20), *made("soft", 20, sharpness=0.4), *made("late", 5, timing=0.5)]
    logs = logarithms(windows)
    weights = dict(zip(WEIGHTS, fit(logs, np.array([w.kind for w in windows])), strict=True))
    assert sum(weights.values()) == pytest.approx(1)
    assert min(weights["sharpness"], weights["timing"]) > 2 * weights["loudness"] > 0
    again = numbers(logs, np.array([*WEIGHTS.values()]))
    assert again == pytest.approx([w.near.number for w in windows])
    assert "| late | 5 | " in table([*windows, *made(HALF, 2)])


@pytest.mark.medium
def test_a_clip_is_nearer_to_itself_than_its_faults(speaker: Speaker) -> None:
    calibration = Calibration(load_network())
    talker = calibration.talker(speaker.clip, speaker.clip.parent)
    assert abs(talker.early) < 0.03
    own = calibration.take(talker.rate, talker.mouth, talker.sound, talker.heard)
    whole = slice(0, len(own.rows))
    figures = own.figures(whole)
    assert figures is not None
    assert figures.opening > 0.3
    takes = dict(calibration.takes(talker, own))
    for kind, early in (("sound 160 ms early", 160), ("sound 80 ms late", -80)):
        assert early_ms(takes[kind].curve(whole), 25.0) == pytest.approx(early, abs=40)
