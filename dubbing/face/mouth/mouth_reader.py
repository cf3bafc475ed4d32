"""Lips read off pictures of the mouth, where landmarks say little.

A ridge regression learns it from the principal components of pictures for which it is known.

N pictures of D pixels, L values of each.
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
        image: (H, W, 3) uint8.
        mouth: (2, 2) px, middle of the mouth and half its width and height.
    """
    scale = SIDE / (2 * REACH * float(mouth[1].max()))
    shift = SIDE / 2 - scale * mouth[0]
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    smooth = cv2.GaussianBlur(grey, (0, 0), 0.5 * max(1.0, 1 / scale))
    matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    part = cv2.warpAffine(smooth, matrix, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray((part - part.mean()) / (part.std() + FAINT)).ravel()


class MouthReader:
    """Reads values of lips off pictures of mouths."""

    def __init__(
        self, pictures: np.ndarray, values: np.ndarray, components: int = COMPONENTS
    ) -> None:
        """Learn from pictures (N, D) and their values (N,) or (N, L)."""
        self._mean = pictures.mean(0)
        _, _, directions = np.linalg.svd(pictures - self._mean, full_matrices=False)
        self._directions = directions[:components].T
        self._usual = values.mean(0)
        parts = (pictures - self._mean) @ self._directions
        square = parts.T @ parts + STRENGTH * np.eye(parts.shape[1])
        self._weights = np.linalg.solve(square, parts.T @ (values - self._usual))

    def read(self, pictures: np.ndarray) -> np.ndarray:
        """The values, as those that were learned from, of pictures (N, D)."""
        parts = (pictures - self._mean) @ self._directions
        return np.asarray(parts @ self._weights + self._usual)
