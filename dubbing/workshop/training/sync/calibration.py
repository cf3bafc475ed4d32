"""How well the closeness tells people from faults, and the weights of its parts.

    python -m dubbing.workshop.training.sync.calibration --cache FOLDER [--network FILE] CLIP...

Clips show one talking person each, with their own speech. Nobody should be among them whom the
network learned from. Windows are compared with the rest of their clip, as a dub with its
film. All faults are made on curves and crops, or by another sound; nothing is rendered.

Letters: F frames, K = 31 offsets, N windows, P parts.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from dubbing import media
from dubbing.face.mouth.mouth_crop import mouth_crops
from dubbing.face.mouth.mouth_shape import mouth_shape
from dubbing.speech.voice_activity import SAMPLE_RATE, at_times
from dubbing.sync.closeness import LEAST, WEIGHTS, Closeness, closeness
from dubbing.sync.curves import MAX_OFFSET, CurveSum, distances, early_ms, estimate
from dubbing.sync.judgement import judge
from dubbing.sync.measure import Sound
from dubbing.sync.mouth_figures import MouthSeries, mouth_figures, of_mouth
from dubbing.sync.network.channels import SoundChannels
from dubbing.sync.network.embeddings import mouth_embeddings
from dubbing.sync.network.sync_network import SyncNetwork, load_network
from dubbing.sync.network.weight_path import SYNC_WEIGHTS
from dubbing.sync.result import FaceResult, Figures, Verdict
from dubbing.sync.sums import SILENT_WEIGHT
from dubbing.workshop.training.sync.clips import recorded
from dubbing.workshop.training.sync.evaluation import area_under_roc, sound_around
from dubbing.workshop.training.sync.faults import Mouth, mouth_faults

SECONDS = 3.0
APART = 0.3  # seconds between a window and the rest of its clip
SHIFTS_MS = (-160, -120, -80, -40, 40, 80, 120, 160)
OTHERS = 8  # sounds of others under every window
MUTED = (0.55, 2.45)  # seconds of a window in which nobody speaks
REAL, HALF = "the person", "half of the clip"
LEAST_WEIGHT = 0.025  # of a part, before they are made to sum to 1: the list has not every fault
# The fit: weight decay, and bounds of the logarithms of weights times the steepness.
DECAY, BOUNDS = 1e-4, (-6.0, 5.0)


@dataclass(frozen=True)
class Talker:
    """A clip of one person: mouth, and sound, which comes `early` seconds too early."""

    name: str
    rate: float
    mouth: Mouth
    samples: np.ndarray
    sound: Sound
    early: float = 0.0

    @property
    def heard(self) -> np.ndarray:
        """Moments of the sound that belong to the frames, (F,)."""
        return (np.arange(len(self.mouth.shapes)) + 0.5) / self.rate - self.early


class Take(NamedTuple):
    """A mouth beside a sound (4, F) as of `Sound.heard`, with their distances (F, K)."""

    series: MouthSeries
    rows: np.ndarray

    def curve(self, chosen: slice | np.ndarray) -> np.ndarray:
        """Of chosen frames, a slice or (F,) bool."""
        total = CurveSum.empty()
        total.add(self.rows[chosen], SILENT_WEIGHT + self.series.voice[chosen])
        return total.curve()

    def figures(self, chosen: slice | np.ndarray) -> Figures | None:
        mask = np.zeros(len(self.rows), bool)
        mask[chosen] = True
        return mouth_figures(self.series, mask, self.curve(chosen))

    def without(self, part: slice) -> Figures | None:
        """Figures of the rest of a clip."""
        apart = round(APART * self.series.rate)
        chosen = np.ones(len(self.rows), bool)
        chosen[max(part.start - apart, 0) : part.stop + apart] = False
        return self.figures(chosen)


class Window(NamedTuple):
    """Whose seconds, with which fault, how close they come to the rest of the clip, and verdict."""

    name: str
    kind: str
    near: Closeness
    verdict: Verdict


class Calibration:
    """Measures windows with one network."""

    def __init__(self, network: SyncNetwork, seconds: float = SECONDS) -> None:
        self.network = network
        self.seconds = seconds
        self.channels = SoundChannels()

    def talker(self, path: Path, cache: Path) -> Talker:
        """A clip as it was recorded, its own offset found."""
        recording, face = recorded(path, cache), self.network.face.numpy()
        crops = mouth_crops(media.read_frames(path), recording.meshes, face)
        found = Talker(
            path.stem,
            1 / float(np.median(np.diff(recording.times))),
            Mouth(mouth_shape(recording.meshes, face), crops),
            recording.samples,
            Sound.of(0.0, recording.samples, self.channels),
        )
        take = self.take(found.rate, found.mouth, found.sound, found.heard)
        return replace(found, early=early_ms(take.curve(slice(None)), found.rate) / 1000)

    def take(self, rate: float, mouth: Mouth, sound: Sound, heard: np.ndarray) -> Take:
        """A mouth of F frames beside what is heard of a sound at moments (F,)."""
        sounds = sound_around(self.network, sound.features, heard, rate, MAX_OFFSET)
        shown = np.arange(len(heard)) / rate
        rows = distances(mouth_embeddings(self.network, *mouth, shown), sounds)
        series = MouthSeries(rate, *of_mouth(*mouth, rate), *at_times(sound.heard, heard).T)
        return Take(series, rows)

    def windows(self, talker: Talker, others: Sequence[Talker]) -> Iterator[Window]:
        """Windows of a talker: the person's own, and those with a fault."""
        own = self.take(talker.rate, talker.mouth, talker.sound, talker.heard)
        frames, count = len(own.rows), round(self.seconds * talker.rate)
        parts = [slice(s, s + count) for s in range(0, frames - count + 1, count // 2)]
        films = [own.without(part) for part in parts]
        for kind, take in self.takes(talker, own):
            for part, film in zip(parts, films, strict=True):
                yield from compared(talker.name, kind, take, part, film)
        silent = self.muted(talker, parts[::2])
        for part, film in zip(parts[::2], films[::2], strict=True):
            yield from compared(talker.name, "talks on in silence", silent, part, film)
        rng = np.random.default_rng(0)
        for part, film in zip(parts, films, strict=True):
            mouth = talker.mouth.at(np.arange(part.start, part.stop))
            for other in rng.choice(len(others), min(OTHERS, len(others)), replace=False):
                room = len(others[other].samples) / SAMPLE_RATE - self.seconds
                begin = rng.uniform(0, room) + np.arange(count) / talker.rate
                take = self.take(talker.rate, mouth, others[other].sound, begin)
                kind = "speech of others"
                yield from compared(talker.name, kind, take, slice(0, count), film)
            far = [p.start for p in parts if abs(p.start - part.start) >= 1.6 * count]
            for start in rng.permutation(far)[:3]:
                moment = talker.heard[start : start + count]
                take = self.take(talker.rate, mouth, talker.sound, moment)
                kind = "own speech of another moment"
                yield from compared(talker.name, kind, take, slice(0, count), film)
        for part in (slice(0, frames // 2), slice(frames // 2, frames)):
            yield from compared(talker.name, HALF, own, part, own.without(part))

    def takes(self, talker: Talker, own: Take) -> Iterator[tuple[str, Take]]:
        """The whole clip with each fault of the mouth, and with its sound moved."""
        yield REAL, own
        faults = mouth_faults(talker.mouth, own.series.loudness, talker.rate)
        for kind, mouth in faults.items():
            yield kind, self.take(talker.rate, mouth, talker.sound, talker.heard)
        for ms in SHIFTS_MS:
            kind = f"sound {abs(ms)} ms {'early' if ms > 0 else 'late'}"
            moved = talker.heard + ms / 1000
            yield kind, self.take(talker.rate, talker.mouth, talker.sound, moved)

    def muted(self, talker: Talker, parts: Sequence[slice]) -> Take:
        """The clip with silence in each of the parts, in which the mouth talks on."""
        samples = talker.samples.copy()
        for part in parts:
            begin = part.start / talker.rate - talker.early
            low, high = (round((begin + edge) * SAMPLE_RATE) for edge in MUTED)
            samples[max(low, 0) : max(high, 0)] = 0
        sound = Sound.of(0.0, samples, self.channels)
        return self.take(talker.rate, talker.mouth, sound, talker.heard)


def compared(
    name: str, kind: str, take: Take, part: slice, film: Figures | None
) -> Iterator[Window]:
    """A window beside its film, if both have enough speech."""
    found, curve, rate = take.figures(part), take.curve(part), take.series.rate
    best = estimate(curve)
    if found is not None and film is not None and best is not None:
        near = closeness(found, film, early_ms(curve, rate))
        seconds = (part.stop - part.start) / rate
        face = FaceResult(0, 0.5, 0.5, seconds, 0, film.certainty, film)
        early = best.offset * 1000 / rate
        verdict, _ = judge(best, early, found, face, near, seconds=seconds)
        yield Window(name, kind, near, verdict)


def logarithms(windows: Sequence[Window]) -> np.ndarray:
    """Logarithms of the parts (N, P), NaN where one was not measured."""
    parts = [[window.near.parts.get(part, np.nan) for part in WEIGHTS] for window in windows]
    return np.log(np.maximum(np.array(parts), LEAST))


def numbers(logs: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Closeness (N,) by weights (P,); see `closeness.number_of`."""
    return np.asarray(np.exp(np.nansum(logs * weights, 1) / (np.isfinite(logs) @ weights)))


def fit(logs: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Weights (P,) by logistic regression: people, and all kinds of faults together, count alike.

    None is below 0.
    """
    real = kinds == REAL
    names, counts = np.unique(kinds[~real], return_counts=True)
    share = dict(zip(names, 1 / counts / len(names), strict=True)) | {REAL: 1 / real.sum()}
    amount, sign = np.array([share[kind] for kind in kinds]), np.where(real, 1.0, -1.0)
    known = np.nan_to_num(logs)

    def loss(values: np.ndarray) -> float:
        steep = np.exp(values[1:])
        margin = sign * (values[0] + known @ steep)
        return float(amount @ np.logaddexp(0, -margin) + DECAY * steep @ steep)

    start = np.append(3.0, np.zeros(logs.shape[1]))
    bounds = [(None, None)] + [BOUNDS] * logs.shape[1]
    found = np.exp(minimize(loss, start, method="L-BFGS-B", bounds=bounds).x[1:])
    weights = np.maximum(found / found.sum(), LEAST_WEIGHT)
    return np.asarray(weights / weights.sum())


def table(windows: Sequence[Window], seconds: float = SECONDS) -> str:
    """Markdown: fitted weights, then a line a kind, by the weights in use and fitted to others."""
    logs = logarithms(windows)
    kinds, names = (np.array([getattr(w, key) for w in windows]) for key in ("kind", "name"))
    counted = kinds != HALF
    fitted = fit(logs[counted], kinds[counted])
    lines = ["| part | in use | fitted |", "|---|---|---|"]
    lines += [
        f"| {part} | {used:.3f} | {found:.3f} |"
        for (part, used), found in zip(WEIGHTS.items(), fitted, strict=True)
    ]
    used = numbers(logs, np.array([*WEIGHTS.values()]))
    strange = np.zeros(len(windows))
    for name in np.unique(names):
        weights = fit(logs[counted & (names != name)], kinds[counted & (names != name)])
        strange[names == name] = numbers(logs[names == name], weights)
    real, verdicts = kinds == REAL, np.array([window.verdict for window in windows])
    head = "number | 5 % | median | 95 % | AUC | left out | pass | warn | fail"
    lines += ["", f"| windows of {seconds:g} s | {head} |"]
    lines.append("|---|---|---|---|---|---|---|---|---|---|")
    faults = counted & ~real
    for kind, chosen in {
        **{kind: kinds == kind for kind in dict.fromkeys(kinds.tolist())},
        "**all faults**": faults,
    }.items():
        low, median, high = np.quantile(used[chosen], [0.05, 0.5, 0.95])
        areas = [area_under_roc(by[real], by[chosen]) for by in (used, strange)]
        shares = [np.mean(verdicts[chosen] == verdict) for verdict in ("pass", "warn", "fail")]
        cells = [f"{value:.3f}" for value in (*areas, *shares)]
        lines.append(
            f"| {kind} | {chosen.sum()} | {low:.2f} | {median:.2f} | {high:.2f} "
            f"| {' | '.join(cells)} |"
        )
    lines += ["", "| person | least window | median | halves |", "|---|---|---|---|"]
    for name in dict.fromkeys(names.tolist()):
        own, half = used[real & (names == name)], used[(kinds == HALF) & (names == name)]
        halves = ", ".join(f"{value:.2f}" for value in half)
        lines.append(f"| {name} | {own.min():.2f} | {np.median(own):.2f} | {halves} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--network", type=Path, default=SYNC_WEIGHTS, help="of train-sync")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of a window")
    parser.add_argument("--cache", type=Path, required=True, help="keeps the measured clips")
    chosen = parser.parse_args(arguments)
    chosen.cache.mkdir(parents=True, exist_ok=True)
    calibration = Calibration(load_network(chosen.network), chosen.seconds)
    talkers = [calibration.talker(path, chosen.cache) for path in chosen.clips]
    found: list[Window] = []
    for talker in talkers:
        found += calibration.windows(talker, [other for other in talkers if other is not talker])
    print(table(found, chosen.seconds))


if __name__ == "__main__":
    main()
