"""How well the sync check finds known shifts, and separates a mouth's own speech from other speech.

    python -m dubbing.workshop.training.sync.evaluation CLIP...  the shipped weights on unseen clips
    python -m dubbing.workshop.training.sync.evaluation --folds 3 CLIP...  trained on some only

A window is a stretch of a longer video. The clip's own offset is first estimated over its whole
length and counted from there; then the sound is shifted by -10..10 frames and must be found, sign
included, within one frame. Other speech is that of other clips, or of another moment. Synthetic
speakers the network never saw follow in a table of their own, counted from their true offset, 0.

Letters: F frames of a clip, E embedding size, K = 51 offsets (15 searched, 10 shifted each way).
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.face.mouth.mouth_shape import canonical_face
from dubbing.speech.voice_activity import STEP_RATE, at_times
from dubbing.sync.curves import MAX_OFFSET, OFFSETS, CurveSum, distances
from dubbing.sync.network.embeddings import mouth_embeddings, sound_embeddings
from dubbing.sync.network.sync_network import SyncNetwork, load_network
from dubbing.sync.sums import SILENT_WEIGHT
from dubbing.workshop.training.sync.clips import TalkingClip, laid_on, recorded
from dubbing.workshop.training.sync.speakers import UNSEEN, speaker_clips
from dubbing.workshop.training.sync.training import SyncTraining, train_network, usable_clips

LENGTHS = (5.0, 3.0, 2.0)
SHIFTS = range(-10, 11)
WIDE = MAX_OFFSET + max(SHIFTS)
NEAR = slice(WIDE - MAX_OFFSET, WIDE + MAX_OFFSET + 1)
# Speech of the same clip counts as another moment from this many seconds on.
APART = 2.0


@dataclass(frozen=True)
class Embedded:
    """A clip through the network: mouths (F, E), distances (F, K), weights (F,), own offset.

    `offset` is measured on the whole length; windows are counted from `truth`.
    """

    clip: TalkingClip
    rate: float
    mouth: np.ndarray
    rows: np.ndarray
    weights: np.ndarray
    offset: int

    @property
    def truth(self) -> int:
        return 0 if self.clip.exact else self.offset


def embed(network: SyncNetwork, clip: TalkingClip) -> Embedded:
    rate = 1 / float(np.median(np.diff(clip.times)))
    mouth = mouth_embeddings(network, clip.shapes, clip.crops, clip.times)
    rows = distances(mouth, sound_around(network, clip.sound, clip.times, rate), WIDE)
    weights = SILENT_WEIGHT + at_times(clip.voice, clip.times)
    best = OFFSETS[int(np.nanargmin(mean_curve(rows, weights)[NEAR]))]
    return Embedded(clip, rate, mouth, rows, weights, best)


def sound_around(
    network: SyncNetwork, sound: np.ndarray, times: np.ndarray, rate: float, reach: int = WIDE
) -> np.ndarray:
    """A sound (T, D) at `times` (F,) and so many frames more each way, (F + 2 reach, E).

    NaN before its beginning and after its end.
    """
    beside = np.arange(1, reach + 1) / rate
    moments = np.concatenate([times[0] - beside[::-1], times, times[-1] + beside])
    found = sound_embeddings(network, sound, moments)
    found[(moments < 0) | (moments > len(sound) / STEP_RATE)] = np.nan
    return found


def mean_curve(rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    total = CurveSum(np.zeros(rows.shape[1]), np.zeros(rows.shape[1]))
    total.add(rows, weights)
    return total.curve()


def confidence(curve: np.ndarray) -> float:
    return float(np.nanmedian(curve) - np.nanmin(curve))


def windows(embedded: Embedded, seconds: float) -> list[slice]:
    """Half-overlapping windows of a clip."""
    count = round(seconds * embedded.rate)
    return [slice(s, s + count) for s in range(0, len(embedded.rows) - count + 1, count // 2)]


def shifts_found(embedded: Embedded, seconds: float) -> list[bool]:
    """For every window and shift whether the shift is found within one frame."""
    hits = []
    for part in windows(embedded, seconds):
        curve = mean_curve(embedded.rows[part], embedded.weights[part])
        for shift in SHIFTS:
            # Sound that comes `shift` frames earlier has its curve that much further up.
            moved = curve[np.array(OFFSETS) - shift + WIDE]
            if np.isfinite(moved).any():
                best = OFFSETS[int(np.nanargmin(moved))]
                hits.append(abs(best - (embedded.truth + shift)) <= 1)
    return hits


def own_confidences(embedded: Embedded, seconds: float) -> list[float]:
    parts = windows(embedded, seconds)
    return [confidence(mean_curve(embedded.rows[p][:, NEAR], embedded.weights[p])) for p in parts]


def other_confidences(
    network: SyncNetwork, embedded: Embedded, others: Sequence[TalkingClip], seconds: float
) -> list[float]:
    """Confidences of the clip's mouths with speech that is not theirs: each window once a clip."""
    confidences = []
    rng = np.random.default_rng(0)
    for other in others:
        length = len(other.sound) / STEP_RATE
        for part in windows(embedded, seconds):
            times = embedded.clip.times[part]
            room = length - seconds - 2 * WIDE / embedded.rate
            if room <= 0:
                continue
            begin = rng.uniform(0, room) + WIDE / embedded.rate
            if other is embedded.clip and abs(begin - times[0]) < seconds + APART:
                continue
            sound = sound_around(network, other.sound, begin + times - times[0], embedded.rate)
            rows = distances(embedded.mouth[part], sound, WIDE)[:, NEAR]
            voice = at_times(other.voice, begin + times - times[0])
            confidences.append(confidence(mean_curve(rows, SILENT_WEIGHT + voice)))
    return confidences


def area_under_roc(positive: Sequence[float], negative: Sequence[float]) -> float:
    """Chance that a positive scores above a negative, ties halved."""
    p, n = np.asarray(positive)[:, None], np.asarray(negative)[None]
    return float(((p > n) + 0.5 * (p == n)).mean())


def table(measured: Sequence[tuple[SyncNetwork, TalkingClip]]) -> str:
    """Markdown: a line a clip, then all together; every clip weighs the same in the shares."""
    clips = [clip for _, clip in measured]
    lines = ["| clip | own offset, frames | 5 s | 3 s | 2 s | confidence | AUC 5 s | 3 s | 2 s |"]
    lines.append("|---|---|---|---|---|---|---|---|---|")
    shares: dict[float, list[float]] = {s: [] for s in LENGTHS}
    own: dict[float, list[float]] = {s: [] for s in LENGTHS}
    other: dict[float, list[float]] = {s: [] for s in LENGTHS}
    for network, clip in measured:
        embedded = embed(network, clip)
        cells = [clip.name, f"{embedded.offset:+d}"]
        areas = []
        for seconds in LENGTHS:
            hits = shifts_found(embedded, seconds)
            cells.append(f"{np.mean(hits):.3f} ({len(hits)})" if hits else "")
            mine = own_confidences(embedded, seconds)
            theirs = other_confidences(network, embedded, clips, seconds)
            areas.append(f"{area_under_roc(mine, theirs):.3f}" if mine and theirs else "")
            own[seconds] += mine
            other[seconds] += theirs
            shares[seconds] += [float(np.mean(hits))] if hits else []
        whole = confidence(mean_curve(embedded.rows[:, NEAR], embedded.weights))
        lines.append(f"| {' | '.join([*cells, f'{whole:.3f}', *areas])} |")
    means = [f"{np.mean(shares[s]):.3f}" for s in LENGTHS]
    areas = [f"{area_under_roc(own[s], other[s]):.3f}" for s in LENGTHS]
    lines.append(f"| **all** | | {' | '.join(means)} | | {' | '.join(areas)} |")
    quartiles = np.quantile(own[5.0], [0.1, 0.25, 0.5]) if own[5.0] else [np.nan] * 3
    wrong = np.quantile(other[5.0], 0.95) if other[5.0] else np.nan
    lines.append("")
    lines.append(
        "Confidence of 5 s windows: 10th percentile {:.3f}, quartile {:.3f}, median {:.3f}; "
        "of other speech, 95th percentile {:.3f}".format(*quartiles, wrong)
    )
    return "\n".join(lines)


def left_out(
    clips: Sequence[TalkingClip],
    face: np.ndarray,
    folds: int,
    settings: SyncTraining,
    unseen: Sequence[TalkingClip],
) -> tuple[list[tuple[SyncNetwork, TalkingClip]], list[tuple[SyncNetwork, TalkingClip]]]:
    """Every person with a network trained on the other folds' people, and `unseen` in turn.

    Synthetic speakers among `clips` are learned from in all folds.
    """
    usable = usable_clips(clips)
    people = [c for c in usable if not c.exact]
    synthetic = [c for c in usable if c.exact]
    pairs, speakers = [], []
    for fold in range(folds):
        others = [c for i, c in enumerate(people) if i % folds != fold]
        network = train_network([*others, *synthetic], face, settings)
        pairs += [(network, c) for i, c in enumerate(people) if i % folds == fold]
        speakers += [(network, c) for i, c in enumerate(unseen) if i % folds == fold]
    return pairs, speakers


def measured_clips(
    paths: Sequence[Path], cache: Path, face: np.ndarray | None, settings: SyncTraining | None
) -> tuple[list[TalkingClip], list[TalkingClip], np.ndarray]:
    """The clips at `paths`, unseen synthetic speakers, and the face (K, 3) both are laid on.

    With `settings`, as training takes them: other takes, and the speakers to learn from as well.
    """
    recordings = [recorded(path, cache) for path in paths]
    face = canonical_face(r.meshes for r in recordings) if face is None else face
    clips = laid_on(recordings, face, takes=settings.takes if settings else 0)
    if settings:
        synthetic = [recorded(path, cache) for path in speaker_clips(cache, settings.speakers)]
        clips += laid_on(synthetic, face, takes=settings.takes, seed=1, exact=True)
    unseen = [recorded(path, cache) for path in speaker_clips(cache, UNSEEN)]
    return clips, laid_on(unseen, face, exact=True), face


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--folds", type=int, default=0, help="train and leave out, so many folds")
    parser.add_argument("--steps", type=int, default=SyncTraining.steps)
    parser.add_argument("--cache", type=Path, help="folder to keep the measured clips in")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        cache = chosen.cache or Path(folder)
        if chosen.folds:
            settings = SyncTraining(steps=chosen.steps)
            clips, unseen, face = measured_clips(chosen.clips, cache, None, settings)
            people, speakers = left_out(clips, face, chosen.folds, settings, unseen)
        else:
            network = load_network()
            clips, unseen, _ = measured_clips(chosen.clips, cache, network.face.numpy(), None)
            people, speakers = ([(network, c) for c in some] for some in (clips, unseen))
    print(table(people), table(speakers), sep="\n\n")


if __name__ == "__main__":
    main()
