"""Claims on stages: a claim is a folder that one process alone can make, with a heartbeat in it.

    model.claim/<token>     beside the stage folder `model`: who holds it, and how far the work is

No file locks: over NFS and Lustre they depend on how these are mounted. Three things are relied
on, which every file system of a cluster does: a folder moves onto an empty folder or none, a name
is removed once, and `rmdir` takes empty folders alone. A claim is therefore made with its
heartbeat in it, and ends with the name of its heartbeat: who takes a stale one over can never
remove a newer one.
"""

import errno
import json
import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from ..errors import ExplainedError, LockedError, StageError
from . import files, heartbeat
from .files import make_folder, patiently, writing
from .heartbeat import Heartbeat

SUFFIX = ".claim"
HEARTBEAT_S = 2.0  # between heartbeats
TAKEN_OVER = "this process gave no sign of life, and another run took the work over"
DENIED = (errno.EACCES, errno.EPERM, errno.EROFS)
STALE_S = 30.0  # without a heartbeat, by the clock of who looks, until a claim is taken over
POLL_S = 0.25  # between looks at claims and folders that change


def place_of(path: Path) -> Path:
    """The folder that claims a path."""
    return path.with_name(path.name + SUFFIX)


def look(path: Path) -> Heartbeat | None:
    """The heartbeat of whoever holds a claim on ``path``; None where nobody does."""
    found = _read(place_of(path))
    return found[1] if found else None


class Claim:
    """A claim that is held. A thread keeps its heart beating."""

    def __init__(self, path: Path, file: Path) -> None:
        self._path, self._file = path, file
        self._message, self._share = "", 0.0
        self._changed, self._lost = False, False
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._thread.start()

    def note(self, message: str, share: float) -> None:
        """Record how far the work is, for other processes.

        Raises:
            StageError: the claim was taken over.
        """
        self._message, self._share, self._changed = message, share, True
        self.check()

    def check(self) -> None:
        """Raises StageError where this process slept so long that the claim was taken over."""
        if self._lost or not self._file.exists():
            raise StageError(TAKEN_OVER, str(self._path), "run it again")

    def release(self) -> None:
        """Give the claim back."""
        self._end.set()
        self._thread.join()
        with suppress(LockedError):
            _remove(self._file)

    def _beat(self) -> None:
        count, last = 0, time.monotonic()
        while not self._end.wait(POLL_S):
            if not self._changed and time.monotonic() - last < HEARTBEAT_S:
                continue
            count, last, self._changed = count + 1, time.monotonic(), False
            try:
                with open(self._file, "r+b") as stream:  # which makes none
                    stream.write(heartbeat.content(count, self._message, self._share))
            except FileNotFoundError:
                self._lost = True
                return
            except OSError:  # a full disk, for one: the work will fail on it, too
                continue


def take(path: Path) -> Claim:
    """Claim ``path``; what holds it and is known to be dead is swept away.

    Raises:
        LockedError: somebody holds it, or did so and has left what cannot be removed.
        ExplainedError: nothing can be written there, or something else lies there.
    """
    place, token = place_of(path), uuid4().hex
    ours = place.with_name(f".{place.name}.{token}")
    while True:
        with writing(ours):
            ours.mkdir()
        try:
            # Gone: swept by who claimed it, or moved by a call whose answer was lost on the way.
            with writing(place), suppress(FileNotFoundError):
                (ours / token).write_bytes(heartbeat.content(0))
                if files.WINDOWS:  # which moves a folder onto none, not even an empty one
                    with suppress(OSError):
                        place.rmdir()
                patiently(lambda: os.rename(ours, place))
            if (place / token).exists():
                break
        except ExplainedError as error:
            shutil.rmtree(ours, ignore_errors=True)
            cause = error.__cause__
            if not isinstance(cause, OSError) or cause.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            if not (found := _read(place)):
                time.sleep(POLL_S)  # over NFS a folder may be seen as it was
                continue
            file, life = found
            if life.here and not life.alive:
                _remove(file)
                continue
            raise LockedError(
                "another run is at work",
                str(path),
                f"wait for process {life.process} on {life.host}, or end it",
            ) from None
    for torn in place.parent.glob(f".{place.name}.*"):
        shutil.rmtree(torn, ignore_errors=True)  # of those who were killed; the others try again
    return Claim(path, place / token)


class Watch:
    """Waits for a claim of somebody else, and ends it where it is stale.

    Only the watcher's clock counts: those of two machines need not agree.
    """

    def __init__(self, path: Path) -> None:
        self._place = place_of(path)
        self._last: tuple[Path, Heartbeat] | None = None
        self._since = 0.0
        self.alive = False  # whether it gave a sign of life since the first look

    def free(self) -> bool:
        """Whether nobody holds it (any more).

        Raises:
            LockedError: who held it is dead, but the claim cannot be removed.
        """
        found = _read(self._place)
        if found is None:
            return True
        file, life = found
        if found != self._last:
            self.alive = self._last is not None and self._last[0] == file
            self._last, self._since = found, time.monotonic()
        if life.here:
            self.alive = life.alive
        elif time.monotonic() - self._since > STALE_S:
            self.alive = False
        else:
            return False
        if not self.alive:
            _remove(file)
        return not self.alive


@contextmanager
def hold(path: Path, *, wait: bool = False) -> Iterator[Claim]:
    """Hold the claim on ``path``, whose folder is made if need be.

    Args:
        wait: for whoever holds it now.

    Raises:
        LockedError: somebody holds it, and gives signs of life.
        ExplainedError: nothing can be written there, or something else lies there.
    """
    make_folder(path.parent)
    watch = Watch(path)
    while True:
        try:
            claim = take(path)
            break
        except LockedError:
            while not watch.free():
                if watch.alive and not wait:
                    raise
                time.sleep(POLL_S)
    try:
        yield claim
    finally:
        claim.release()


def sweep(folder: Path) -> None:
    """End the claims in a folder whose processes are known to be dead.

    One that was killed after its work was done leaves a claim that nobody needs to take over.
    """
    for place in folder.glob(f"*{SUFFIX}"):
        if (found := _read(place)) and found[1].here and not found[1].alive:
            with suppress(LockedError):  # nobody needs it now; who does, says so
                _remove(found[0])


def _read(place: Path) -> tuple[Path, Heartbeat] | None:
    """The heartbeat in a claim's folder, and its file."""
    try:
        for file in place.iterdir():
            try:
                return file, Heartbeat(**json.loads(file.read_bytes()))
            except (ValueError, TypeError):  # read while it was written
                return file, Heartbeat("", "", 0, "")
    except OSError:
        pass
    return None


def _remove(file: Path) -> None:
    """End a claim by its heartbeat: a newer one in the same place stays.

    Raises:
        LockedError: it is of a run that is dead, and may not be removed by who this is.
    """
    try:
        patiently(file.unlink)
        file.parent.rmdir()
    except OSError as error:
        if error.errno not in DENIED:  # somebody else was quicker
            return
        what = f"a run that ended has left its claim, which cannot be removed: {error.strerror}"
        raise LockedError(what, str(file), f"remove the folder {file.parent}") from error
