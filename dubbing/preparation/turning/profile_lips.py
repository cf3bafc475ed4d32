"""Lips of a head that is seen from the side: read off the picture, by what is heard meanwhile.

FaceMesh lays the lips of a profile anywhere, or finds no face. But what changes in pictures of a
mouth is the lips above all, and the sound says roughly what these do. So what in the pictures
follows the lips that are heard is read off: it is nearer to the true lips than what is heard.

T frames, N of them seen from the front, K in profile, D pixels of a mouth's picture; L = 7 lip
lengths of `lip_measures`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import (
    CHIN,
    JAW_BACK,
    LEFT_EAR,
    NOSE_BASE,
    NOSE_TIP,
    RIGHT_EAR,
    RIGID,
)
from dubbing.face.mouth.lip_measures import LIP_DISTANCES, TOUCHING, lip_lengths, standardised
from dubbing.face.mouth.mouth_reader import REACH, MouthReader, mouth_picture
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.face.mouth.similarity import similarity
from dubbing.media import MediaInfo

# Turn from which landmarks say nothing of lips, and from which a face may have none.
SIDEWAYS, PROFILE = np.radians(72.0), np.radians(60.0)
FEWEST, FRONT = 24, 25  # frames in profile, and from the front
COMPONENTS = 6  # of pictures: more follow what is heard wrongly
FOLDS = 4  # of the frames: each is read by what was learned from the others
# Correlation of the opening so read with the one that is heard: at least, and times the root of the
# number of frames. With other speech 7 % of films have as much.
LEAST, SURE = 0.2, 3.0
AGREED = 0.7  # correlation of openings from which landmarks are right: what is read is no better
STRENGTH = 0.05  # of the regression from lengths to shapes, a frame
BESIDE = 1.0  # seconds of sound before and after the frames


@dataclass(frozen=True)
class LipShapes:
    """How one person's face changes with the lengths of its lips.

    Attributes:
        lengths: (N, L) of frames from the front, eye distances.
        weights: (L, 478, 3) head units, for lengths of mean 0 and variance 1.
    """

    lengths: np.ndarray
    weights: np.ndarray

    @staticmethod
    def of(points: np.ndarray, shape: np.ndarray) -> LipShapes:
        """That of landmarks (N, 478, 3) px and their mean shape (478, 3)."""
        seen = aligned(points, shape)
        lengths = lip_lengths(seen[..., :2])
        parts = standardised(lengths)
        square = parts.T @ parts + STRENGTH * len(parts) * np.eye(len(parts.T))
        changes = (seen - seen.mean(0)).reshape(len(seen), -1)
        weights = np.linalg.solve(square, parts.T @ changes)
        return LipShapes(lengths, weights.reshape(-1, *shape.shape))

    def changes(self, lips: np.ndarray) -> np.ndarray:
        """By how much shapes (K, 478, 3) with lips (K, L) differ from the mean shape.

        What moves down moves backwards, too, as the jaw hinges: from the front that is not seen.
        """
        usual, spread = self.lengths.mean(0), np.maximum(self.lengths.std(0), 1e-6)
        found = np.tensordot((lips - usual) / spread, self.weights, 1)
        found[..., 2] = JAW_BACK * found[..., 1]
        return np.asarray(found)


def told_lengths(points: np.ndarray, valid: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Lip lengths (T, L), eye distances, of landmarks (T, 478, 3) px; NaN where not valid (T,)."""
    out = np.full((len(points), len(LIP_DISTANCES)), np.nan)
    out[valid] = lip_lengths(aligned(points[valid], shape)[..., :2])
    return out


def aligned(points: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Landmarks (N, 478, 3) laid on a shape (478, 3) by what speech does not move."""
    points, rigid = points.astype(np.float64), list(RIGID)
    return similarity(points[:, rigid], shape[rigid])(points)


def read_lips(pictures: np.ndarray, heard: np.ndarray) -> np.ndarray | None:
    """Lips (K, L) in pictures (K, D), with mean and spread of the heard ones (K, L).

    None where the pictures do not follow the sound: somebody else speaks, or nobody.
    """
    count = len(pictures)
    if count < FEWEST or not heard.std(0).all():
        return None
    fold = np.arange(count) * FOLDS // count
    held = np.zeros(count)
    for k in range(FOLDS):
        reader = MouthReader(pictures[fold != k], heard[fold != k, 0], COMPONENTS)
        held[fold == k] = reader.read(pictures[fold == k])
    if not np.corrcoef(held, heard[:, 0])[0, 1] > max(LEAST, SURE / np.sqrt(count)):
        return None
    read = MouthReader(pictures, heard, COMPONENTS).read(pictures)
    even = (read - read.mean(0)) / np.maximum(read.std(0), 1e-6)
    return np.asarray(heard.mean(0) + even * heard.std(0))


@dataclass(frozen=True)
class Profiles:
    """Frames of a film that show a profile, and what their lips are read by.

    Attributes:
        crops: (T, S, S, 3) uint8. places: (T, 478, 2) px, landmarks of the mean face.
        turn: (T,) rad between the face and the camera; NaN where that is not known.
        lengths: (T, L) eye distances, of the lips as landmarks tell them; NaN without landmarks.
        front: (T,) bool, frames seen from the front.
    """

    crops: np.ndarray
    places: np.ndarray
    turn: np.ndarray
    lengths: np.ndarray
    front: np.ndarray

    def lips_step(
        self, info: MediaInfo, first: int, progress: ReportShare
    ) -> dict[str, np.ndarray]:
        """Lip lengths in the profiles of which landmarks do not tell them.

        Args:
            info: of the frames. first: of them in the clip.

        Returns:
            lips (T, L), eye distances; NaN where they were not read.
        """
        lips = np.full_like(self.lengths, np.nan)
        some = (self.turn > PROFILE) & ~self.front
        told = np.isfinite(self.lengths).all(1)
        unsure = some & told & (self.turn > SIDEWAYS)
        wanted = (some & ~told) | unsure
        enough = some.sum() >= FEWEST and self.front.sum() >= FRONT
        if wanted.any() and enough and info.audio_rate is not None:
            own = self.lengths[self.front]
            heard = heard_lips(info, first, self.front, own)
            places = zip(self.crops[some], self.places[some], strict=True)
            pictures = [profile_picture(image, points) for image, points in places]
            read = read_lips(np.stack(pictures), heard[some])
            if read is not None:
                lips[some] = own.mean(0) + read * own.std(0)
                if agree(lips[unsure, 0], self.lengths[unsure, 0]):
                    wanted &= ~unsure
                lips[~wanted] = np.nan
        progress(1.0)
        return {"lips": lips}


def agree(read: np.ndarray, told: np.ndarray) -> bool:
    """Whether openings (K,) that were read, and that landmarks tell, are the same ones."""
    if len(read) < FEWEST or not told.std():
        return False
    return bool(np.corrcoef(read, told)[0, 1] > AGREED)


def profile_picture(image: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """The mouth of a profile, (D,), as if it looked to the right.

    Args:
        image: (S, S, 3) uint8. landmarks: (478, 2) px.
    """
    if landmarks[NOSE_TIP, 0] < landmarks[[LEFT_EAR, RIGHT_EAR], 0].mean():
        image = np.ascontiguousarray(image[:, ::-1])
        landmarks = landmarks * [-1, 1] + [image.shape[1] - 1, 0]
    reach = float(np.linalg.norm(landmarks[CHIN] - landmarks[NOSE_BASE])) / REACH
    place = np.stack([landmarks[list(OUTER_LIP)].mean(0), [reach, reach]])
    return mouth_picture(image, place)


def heard_lips(info: MediaInfo, first: int, front: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Lips (T, L) that are heard in the frames of a film, as its person moves them.

    Args:
        info: of the frames. first: of them in the clip.
        front: (T,) bool, the N frames of `lengths` (N, L).

    Returns:
        Of mean 0 and variance 1 in front frames.
    """
    import torch

    from dfrf.field.speaker_adaptation import SpeakerAdaptation, extended
    from dubbing.sound_to_lips.speech_frames import lips_of_file
    from dubbing.speech import voice_activity as voice

    rate = float(info.rate)
    start = max(0.0, first / rate - BESIDE)
    seconds = (first + info.frames) / rate + BESIDE - start
    found = lips_of_file(info.path, start=start, seconds=seconds)
    moments = (first + np.arange(info.frames) + 0.5) / rate - start
    heard = torch.from_numpy(voice.at_times(found, moments)).float()
    adaptation = SpeakerAdaptation()
    own = torch.from_numpy(standardised(lengths)).float()
    touching = torch.from_numpy(lengths[:, 0] < TOUCHING).float()
    adaptation.fit(heard[torch.from_numpy(front)], own, touching)
    with torch.no_grad():
        return np.asarray(adaptation(extended(heard))[0])
