"""Time left of a run, from the time that its stages are expected to take, and do take."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import RLock

from ..graph.stage_id import StageId

SETTLES = 30.0  # seconds in which what is shown follows a longer estimate
SURE = 0.1  # share of a stage from which on its own speed says something of others of its kind


@dataclass
class _Running:
    begun: float
    share: float = 0.0


class TimeLeft:
    """Seconds that are left of a run.

    A stage that has begun is believed the more the further it is. How much longer than expected
    its kind takes here holds for those of its kind that are to come; of other kinds, the mean.
    What is shown falls at once, but rises over `SETTLES` seconds. Several threads may ask and tell.

    Args:
        expected: seconds of every stage that is to be done.
        workers: how many stages are done at once.
        clock: seconds.
    """

    def __init__(
        self, expected: Mapping[StageId, float], clock: Callable[[], float], workers: int = 1
    ) -> None:
        self._expected = {**expected}
        self._workers, self._clock = workers, clock
        self._running: dict[StageId, _Running] = {}
        self._took: dict[str, tuple[float, float]] = {}  # by kind: expected, and taken
        self._shown: float | None = None
        self._looked = clock()
        self._lock = RLock()

    def begin(self, key: StageId) -> None:
        with self._lock:
            self._running[key] = _Running(self._clock())

    def progress(self, key: StageId, share: float) -> None:
        """So much of a stage is done."""
        with self._lock:
            if (stage := self._running.get(key)) is not None:
                stage.share = min(max(stage.share, share), 1.0)

    def end(self, key: StageId) -> None:
        """A stage is done, or will not be."""
        with self._lock:
            stage, wanted = self._running.pop(key, None), self._expected.pop(key, 0.0)
            if stage is not None and wanted:
                before, taken = self._took.get(key.kind, (0.0, 0.0))
                now = taken + self._clock() - stage.begun
                self._took[key.kind] = (before + wanted, now)

    def of(self, key: StageId) -> float | None:
        """Seconds left of a stage that has begun; None where nothing is known of it."""
        with self._lock:
            stage, wanted = self._running[key], self._expected.get(key, 0.0) * self._pace(key)
            taken = self._clock() - stage.begun
            if not wanted and stage.share < SURE:
                return None
            by_speed = taken / stage.share if stage.share else wanted
            trust = stage.share if wanted else 1.0
            return max((1 - trust) * wanted + trust * by_speed - taken, 0.0)

    def all(self) -> float | None:
        """Seconds left of the run, as they are shown; None where nothing is known of it."""
        with self._lock:
            if not self._expected:
                return None
            running = [self.of(key) or 0.0 for key in self._running]
            waiting = [
                seconds * self._pace(key)
                for key, seconds in self._expected.items()
                if key not in self._running
            ]
            now = self._clock()
            left = max(sum([*running, *waiting]) / self._workers, *running, 0.0)
            passed, self._looked = now - self._looked, now
            if self._shown is not None and left > self._shown - passed:
                low = max(self._shown - passed, 0.0)
                left = low + (left - low) * min(passed / SETTLES, 1.0)
            self._shown = left
            return left

    def _pace(self, key: StageId) -> float:
        """How much longer than expected stages of its kind take here."""
        took = {**self._took}
        for other, stage in self._running.items():
            if stage.share > SURE and other != key and (wanted := self._expected.get(other)):
                before, taken = took.get(other.kind, (0.0, 0.0))
                now = self._clock() - stage.begun
                took[other.kind] = (before + wanted * stage.share, taken + now)
        own = took.get(key.kind)
        before, taken = own or tuple(map(sum, zip(*took.values(), strict=True))) or (1.0, 1.0)
        return taken / before if before else 1.0
