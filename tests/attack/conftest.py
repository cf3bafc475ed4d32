"""How many cases are made, from which seed, in which folders; and the table at the end.

In the ordinary suite the cases are few and always the same. DFRF_ATTACK=N makes N times as many,
from the seed of `--hypothesis-seed`; see `make attack`.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import hypothesis
import pytest
from hypothesis import HealthCheck, Phase, configuration, settings

from tests import clips, fakes
from tests.attack import rule

TIMES = int(os.environ.get("DFRF_ATTACK", "0"))
CACHE = tempfile.TemporaryDirectory()
configuration.set_hypothesis_home_dir(CACHE.name)
settings.register_profile(
    "attack",
    database=None,
    deadline=None,
    derandomize=not TIMES,
    print_blob=True,
    phases=[Phase.explicit, Phase.generate],  # a case as found: to make it smaller takes hours
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("attack")
Room = Callable[[], AbstractContextManager[Path]]


@pytest.fixture(scope="session")
def material(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `ann.mp4`, `it.wav` and `manifest.json`, which holds."""
    folder = tmp_path_factory.mktemp("material")
    clips.write_clip(folder / "ann.mp4", 30)
    clips.write_sound(folder / "it.wav", 1.2)
    return folder


@pytest.fixture(scope="session")
def room(material: Path, tmp_path_factory: pytest.TempPathFactory) -> Room:
    """Makes a room of its own for a case, with copies of the material; gone after it."""
    parent = tmp_path_factory.mktemp("rooms")

    @contextmanager
    def made() -> Iterator[Path]:
        folder = parent / "room"
        shutil.copytree(material, folder)
        before = os.getcwd()
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)
            shutil.rmtree(os.fsencode(folder))

    return made


@pytest.fixture(scope="module")
def stand_ins() -> Iterator[None]:
    """Stages that do no work; the stages that listen and compose are the true ones."""
    with pytest.MonkeyPatch.context() as patch:
        fakes.install(patch.setattr)
        yield


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table of the attack."""
    if TIMES and rule.TALLY.cases:
        seed = hypothesis.core.global_force_seed
        terminalreporter.section(f"attack, seed {seed}")
        for line in rule.TALLY.table():
            terminalreporter.write_line(line)
