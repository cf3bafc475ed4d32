"""How far a mouth is open, read off its picture: on turned heads landmarks say little.

The film that is dubbed shows the same head in the same poses and light, and how far its mouth is
open is known. A ridge regression from the principal components of the mouth's picture learns it.

T frames, D pixels of a mouth's picture.
"""

import cv2
import numpy as np

SIDE = 40  # px of a mouth's picture
REACH = 1.4  # of it, in half widths of the mouth
COMPONENTS, STRENGTH = 15, 1.0  # of the regression
FAINT = 8.0  # grey levels: what varies less is not made stronger


def mouth_picture(image: np.ndarray, mouth: np.ndarray) -> np.ndarray:
    """The mouth in an image, (D,) of mean 0 and one contrast.

    Args:
        image: (S, S, 3) uint8.
        mouth: (2, 2) px, middle of the mouth and half its width and height.
    """
    scale = SIDE / (2 * REACH * float(mouth[1].max()))
    shift = SIDE / 2 - scale * mouth[0]
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(grey, (0, 0), 0.5 * max(1.0, 1 / scale))
    matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    part = cv2.warpAffine(smooth, matrix, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray((part - part.mean()) / (part.std() + FAINT)).ravel()


class OpeningReader:
    """Reads openings off pictures of mouths."""

    def __init__(self, pictures: np.ndarray, openings: np.ndarray) -> None:
        """Learn from pictures (T, D) and their openings (T,)."""
        self._mean = pictures.mean(0)
        _, _, directions = np.linalg.svd(pictures - self._mean, full_matrices=False)
        self._directions = directions[:COMPONENTS].T
        self._usual = openings.mean()
        parts = (pictures - self._mean) @ self._directions
        square = parts.T @ parts + STRENGTH * np.eye(parts.shape[1])
        self._weights = np.linalg.solve(square, parts.T @ (openings - self._usual))

    def read(self, pictures: np.ndarray) -> np.ndarray:
        """The openings (T,) of pictures (T, D)."""
        parts = (pictures - self._mean) @ self._directions
        return np.asarray(parts @ self._weights + self._usual)
