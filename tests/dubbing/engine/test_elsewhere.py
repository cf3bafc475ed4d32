"""The engine is of use outside of this package: copied under another name, with other stages."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import pytest

import dubbing.engine

pytestmark = pytest.mark.medium


# `sitecustomize` of every process of the project, so that none finds this repository.
ALONE = """
import sys

class Nothing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("dubbing", "dfrf", "tests"):
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Nothing())
"""

TOY = '''
"""Two texts: one in capitals, one counted, and a report of both."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

from work_engine.graph.fields import Setting
from work_engine.graph.graph import Job, Jobs
from work_engine.graph.stage import Progress, Stage

HALVES = {"first": (0, 2), "second": (2, 4)}  # lines


@dataclass(frozen=True, kw_only=True)
class Capitals(Stage):
    """The lines of a text in capitals, a file each. Half of them can be done on one machine."""

    text: Path
    lines: Setting[tuple[int, int]] = (0, 4)

    def run(self, out: Path, progress: Progress) -> None:
        first, stop = self.lines
        for number, line in enumerate(self.text.read_text().splitlines()[first:stop], first):
            if not (out / f"{number}.txt").exists():
                (out / f"{number}.txt").write_text(line.upper())
            progress(line, (number + 1 - first) / (stop - first))

    def parts(self) -> Mapping[str, Self]:
        return {name: replace(self, lines=lines) for name, lines in HALVES.items()}


@dataclass(frozen=True, kw_only=True)
class Count(Stage):
    """How many words a text has."""

    packages: ClassVar[tuple[str, ...]] = ("toy_words",)

    text: Path

    def run(self, out: Path, progress: Progress) -> None:
        from toy_words import words

        (out / "count.txt").write_text(str(len(words(self.text.read_text()))))


@dataclass(frozen=True, kw_only=True)
class Report(Stage):
    """Both results under a title."""

    capitals: Capitals
    count: Count
    title: str

    def run(self, out: Path, progress: Progress) -> None:
        lines = [path.read_text() for path in sorted(self.capitals.folder.glob("?.txt"))]
        count = (self.count.folder / "count.txt").read_text()
        (out / "report.txt").write_text("\\n".join([self.title, *lines, count]))


def jobs_of(folder: Path) -> Jobs:
    texts = Job("text", "both", folder / "work" / "texts")
    capitals = texts.add(Capitals(text=folder / "loud.txt"))
    count = texts.add(Count(text=folder / "long.txt"))
    report = Job("report", "it", folder / "work" / "report", waits_for=(texts.label,))
    report.add(Report(capitals=capitals, count=count, title="both"))
    return Jobs.of([texts, report])
'''

WORDS = """
def words(text):
    return text.split()
"""

TASK = """
import sys
from pathlib import Path
from toy import jobs_of
from work_engine.running import task

def job_of(label, folder):
    return jobs_of(Path(folder)).by_label[label]

def main(argument):
    code = task.main(argument, job_of)
    assert not {"dubbing", "dfrf"} & {name.split(".")[0] for name in sys.modules}
    return code
"""

RUN = """
import json
import sys
from contextlib import closing
from pathlib import Path

from toy import jobs_of
from work_engine.planning import planner
from work_engine.running import runner
from work_engine.running.executors import InLine, Program
from work_engine.running.processes import Processes

class Quiet:
    def overall(self, done, total): ...
    def begin(self, job, stage, reasons): ...
    def progress(self, job, stage, message, share): ...
    def end(self, job, stage, failure): ...

if __name__ == "__main__":
    folder, workers = Path(sys.argv[1]), int(sys.argv[2])
    program = Program("toy_task", (str(folder),))
    jobs = jobs_of(folder)
    planned = [row.stage.kind for row in planner.rows(jobs) if row.state == planner.RUN]
    with closing(Processes(program, workers) if workers else InLine()) as executor:
        outcomes = runner.run(jobs, runner.Options(), Quiet(), executor)
    try:
        import dubbing
    except ModuleNotFoundError:
        pass
    else:
        raise AssertionError(dubbing)
    assert not {"dubbing", "dfrf"} & {name.split(".")[0] for name in sys.modules}
    print(json.dumps({
        "planned": planned,
        "states": [outcome.state for outcome in outcomes.values()],
        "made": sorted(kind for outcome in outcomes.values() for kind in outcome.seconds),
        "failures": [str(o.failure) + o.failure.trace for o in outcomes.values() if o.failure],
    }))
"""


class Project:
    """Another project, which has a copy of the engine, and the folder of its texts."""

    def __init__(self, root: Path, workers: int) -> None:
        self.code, self.data, self.workers = root / "other_project", root / "data", workers
        own = Path(dubbing.engine.__path__[0])
        shutil.copytree(own, self.code / "work_engine", ignore=shutil.ignore_patterns("__*__"))
        (self.code / "work_engine" / "__init__.py").touch()
        files = {"sitecustomize": ALONE, "toy": TOY, "toy_words": WORDS, "toy_task": TASK}
        for name, text in {**files, "toy_run": RUN}.items():
            (self.code / f"{name}.py").write_text(text)
        self.data.mkdir()
        self.write("loud", "one\ntwo\nthree\nfour")
        self.write("long", "some words")

    def write(self, name: str, text: str) -> None:
        (self.data / f"{name}.txt").write_text(text)

    def run(self) -> dict[str, Any]:
        """A run in a process of its own: the stages that it made, and the states of its jobs."""
        packages = [sysconfig.get_path(name) for name in ("purelib", "platlib")]
        path = os.pathsep.join(dict.fromkeys([str(self.code), *packages]))
        # Bytecode is told apart by the second and the size of its source: not by a quick change.
        alone = {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(
            [sys.executable, "-P", "-m", "toy_run", str(self.data), str(self.workers)],
            cwd=self.data,
            env={**os.environ, **alone},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found: dict[str, Any] = json.loads(done.stdout)
        assert found["failures"] == []
        return found

    @property
    def report(self) -> str:
        """The last result."""
        return (self.data / "work" / "report" / "report" / "report.txt").read_text()


@pytest.fixture(params=[0, 2], ids=["in line", "two processes"])
def project(tmp_path: Path, request: pytest.FixtureRequest) -> Project:
    return Project(tmp_path, request.param)


def test_another_project_has_its_stages_brought_up_to_date(project: Project) -> None:
    first = project.run()
    assert first["planned"] == first["made"] == ["capitals", "count", "report"]
    assert first["states"] == ["made", "made"]
    assert project.report == "both\nONE\nTWO\nTHREE\nFOUR\n2"
    assert project.run() == {"planned": [], "states": ["kept", "kept"], "made": [], "failures": []}
    project.write("loud", "one\ntwo\nthree\nfive")
    assert project.run()["made"] == ["capitals", "report"]
    assert project.report == "both\nONE\nTWO\nTHREE\nFIVE\n2"
    project.write("long", "other words")  # as many: the report does not follow
    assert project.run()["made"] == ["count"]
    project.write("long", "some more words")
    assert project.run()["made"] == ["count", "report"]
    assert project.report.endswith("\n3")


def test_its_code_counts_and_that_of_the_modules_it_imports(project: Project) -> None:
    project.run()
    words = project.code / "toy_words.py"
    words.write_text(WORDS.replace("text.split()", "list(text)"))
    assert project.run()["made"] == ["count", "report"]
    toy = project.code / "toy.py"
    toy.write_text(TOY.replace("line.upper()", "line.title()"))
    assert project.run()["made"] == ["capitals", "count", "report"]  # all of one module
    assert project.report == "both\nOne\nTwo\nThree\nFour\n10"
    words.write_text(f"# A comment\n{words.read_text()}")
    assert project.run()["made"] == []
