"""Figures of dubs that are perfect, missing, or wrong in one way."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from dubbing.workshop.synthetic.anatomy.face import face_by_name
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.rendering.camera import FLIP, UNIT, Pose
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State
from dubbing.workshop.true_dubs.figures import DubFigures, differs, extent, mean_of, psnr

pytestmark = pytest.mark.medium
SIZE, FRAMES = 256, 12
OPENINGS = 0.5 + 0.5 * np.sin(np.arange(FRAMES))


@dataclass(frozen=True)
class Films:
    """Frames of the film and of the true dub, with the mouth's box."""

    film: list[np.ndarray]
    truth: list[np.ndarray]
    mouth: np.ndarray


@pytest.fixture(scope="module")
def films() -> Films:
    renderer = Renderer(face_by_name("alba"), SIZE)
    pose = Pose(np.eye(3), FLIP @ REST_SHIFT / UNIT)
    film, truth = (
        [renderer.render(State(pose, MouthShape(jaw=jaw, part=0.3 * jaw))).image for jaw in jaws]
        for jaws in (OPENINGS[::-1], OPENINGS)
    )
    pixels = renderer.project(pose, renderer.model.mouth_box())
    low, high = pixels.min(0), pixels.max(0)
    return Films(film, truth, np.stack([(low + high) / 2, (high - low) / 2]))


def measured(
    films: Films, dubs: list[np.ndarray], cover: np.ndarray | None = None
) -> dict[str, float]:
    figures = DubFigures(25)
    for dub, film, truth in zip(dubs, films.film, films.truth, strict=True):
        figures.add(dub, film, truth, films.mouth, cover)
    return figures.figures()


def grain(k: int, deviation: float) -> np.ndarray:
    return np.random.default_rng(k).normal(0, deviation, (SIZE, SIZE, 3))


def test_a_perfect_dub(films: Films) -> None:
    found = measured(films, films.truth)
    assert found["dubbed"] == 1
    assert found["psnr"] == found["psnr_mouth"] == pytest.approx(68.1, abs=0.1)
    for name in ("seam", "chin", "sharpness", "ssim_mouth", "opening_r", "texture_ratio"):
        assert found[name] == pytest.approx(1), name


def test_a_film_that_was_not_dubbed(films: Films) -> None:
    found = measured(films, films.film)
    assert found["dubbed"] == 0
    assert found["psnr_mouth"] < 30
    assert found["opening_r"] < 0.8


def test_a_blurred_dub(films: Films) -> None:
    found = measured(films, [cv2.GaussianBlur(x, (0, 0), 2.0) for x in films.truth])
    assert found["sharpness"] < 0.8
    assert found["chin"] < 0.8


def test_a_dub_without_the_films_noise(films: Films) -> None:
    def noisy(frames: list[np.ndarray], deviation: float) -> list[np.ndarray]:
        pairs = enumerate(frames)
        return [np.clip(x + grain(k, deviation), 0, 255).astype(np.uint8) for k, x in pairs]

    film, truth = noisy(films.film, 6), noisy(films.truth, 6)
    given = Films(film, truth, films.mouth)
    assert measured(given, truth)["noise"] == pytest.approx(1)
    assert measured(given, noisy(films.truth, 3))["noise"] == pytest.approx(0.5, abs=0.07)
    assert "noise" not in measured(films, films.truth)


def test_skin_that_moves_is_no_noise(films: Films) -> None:
    """Its texture changes from frame to frame, but the wall beside it stays."""
    x, y = films.mouth[0].astype(int)
    skin = np.s_[y - 70 : y + 70, x - 60 : x + 60]
    film, truth = ([f.copy() for f in frames] for frames in (films.film, films.truth))
    for k, frames in enumerate(zip(film, truth, strict=True)):
        for frame in frames:
            frame[skin] = np.clip(frame[skin] + grain(k, 6)[skin], 0, 255)
    assert "noise" not in measured(Films(film, truth, films.mouth), truth)


def test_what_is_in_front_must_stay(films: Films) -> None:
    cover = np.zeros((SIZE, SIZE))
    x, y = films.mouth[0].astype(int)
    cover[y - 20 : y + 20, x - 20 : x] = 1
    kept = measured(films, [t.copy() for t in films.truth], cover)
    assert kept["covered_dubbed"] == 1
    over = cover[..., None] > 0
    true = [np.where(over, 40, x).astype(np.uint8) for x in films.truth]
    film = [np.where(over, 40, x).astype(np.uint8) for x in films.film]
    given = Films(film, true, films.mouth)
    assert measured(given, true, cover)["cover_changed"] == 0
    assert measured(given, films.truth, cover)["cover_changed"] > 0.9


def test_small_helpers() -> None:
    image = np.zeros((20, 20, 3), np.uint8)
    other = image.copy()
    other[3, 4, 1] = 9
    assert differs(image, other, 8).sum() == 1
    assert not differs(image, other, 9).any()
    assert np.isnan(psnr(image, other, np.zeros((20, 20), bool)))
    rows, columns = extent(np.array([[18.0, 5], [6, 2]]), 20)
    assert (rows.start, rows.stop, columns.start, columns.stop) == (3, 7, 12, 20)
    assert mean_of([{"a": 1.0, "b": 2}, {"a": 3.0}]) == {"a": 2, "b": 2}
