"""Every command and file that a document names is there; documents stay short and narrow."""

from __future__ import annotations

import importlib
import json
import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import typer
from typer.testing import CliRunner

from dubbing.cli.main import app
from dubbing.manifest.keys import yaml_lines
from dubbing.stages import KINDS
from dubbing.workshop.lab.variants import PRESET_OF_METHOD
from tests import clips

ROOT = Path(__file__).resolve().parents[1]
PLACES = ("*.md", "docs/**/*.md", "dubbing/**/*.md", "manifests/*.yaml", "Makefile")
PROGRAM = typer.main.get_command(app)
STARTS = ("dfrf", "python", "pip", "make")
# Words that a document may put where a value belongs.
PLACEHOLDER = re.compile(r"[A-Z]+(\.json)?")


class Command(NamedTuple):
    """What a document tells to run, and where; ``words`` begin with one of STARTS."""

    place: str
    words: tuple[str, ...]


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of what is code: recipes, comments of a manifest, blocks and spans."""
    source = path.read_text(encoding="utf-8")
    if path.suffix != ".md":
        source = source.replace("\\\n", "  ")
        sort = r"^\t(.*)$" if path.name == "Makefile" else r"`([^`]*)`"
        for found in re.finditer(sort, source, re.MULTILINE):
            yield source.count("\n", 0, found.start()) + 1, found[1]
        return
    fence = False
    for number, line in enumerate(source.splitlines(), 1):
        if line.startswith("```"):
            fence = not fence
        elif fence:
            yield number, line
        else:
            spans = re.findall(r"`([^`]+)`", line)
            # A row of a table of commands names its options after the command.
            if line.startswith("| `dfrf "):
                options = [span.replace("\\|", "|") for span in spans[1:] if span[:2] == "--"]
                yield number, " ".join([spans[0], *options])
            else:
                yield from ((number, span) for span in spans)


def words_of(text: str) -> list[str]:
    """A line of a shell without its variables and its comment; empty where it is none."""
    text = re.sub(r"\$\((\w+)\)", lambda m: {"BIN": ".venv/bin"}.get(m[1], "X"), text)
    text = re.sub(r"\[(--\w+) (\w+) \.\.\.\]", r"\1 \2", text)
    text = re.sub(r"\s#\s.*", "", text.strip())
    try:
        words = shlex.split(text)
    except ValueError:
        return []
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        del words[0]  # of the environment
    return words


def commands() -> Iterator[Command]:
    for path in sorted(path for place in PLACES for path in ROOT.glob(place)):
        for number, text in texts(path):
            words = words_of(text)
            name = Path(words[0]).name.replace("python3.11", "python") if words else ""
            place = f"{path.relative_to(ROOT)}:{number}"
            if name.startswith("--"):
                yield Command(place, ("options", *words))
            elif name in STARTS and len(words) > 1:
                yield Command(place, (name, *words[1:]))


COMMANDS = list(commands())
OURS = [c for c in COMMANDS if c.words[0] == "dfrf"]
MODULES = [c for c in COMMANDS if c.words[:2] == ("python", "-m")]
TARGETS = [c for c in COMMANDS if c.words[0] == "make"]
OPTIONS = [c for c in COMMANDS if c.words[0] == "options" and c.place[:9] != "CHANGELOG"]
EXTRAS = [c for c in COMMANDS if c.words[0] == "pip"]


def named(command: Command) -> str:
    return f"{command.place} {' '.join(command.words)}"


def wrong(words: tuple[str, ...]) -> str:
    """What ``dfrf`` has against a call, or nothing. Files need not be there."""
    name, *arguments = words
    if name in ("-h", "--help", "--version", "--install-completion"):
        return ""
    known = PROGRAM.commands.get(name)  # type: ignore[attr-defined]
    if known is None:
        return f"no command {name}"
    options = {
        opt: p for p in known.params for opt in (*p.opts, *p.secondary_opts) if opt[0] == "-"
    }
    places = [p for p in known.params if not p.opts[0].startswith("-")]
    given = 0
    rest = iter(arguments)
    for word in rest:
        # `--device auto|cpu|cuda` and `--keep-going/--fail-fast` name several at once.
        if not word.startswith("--"):
            given += 1
            continue
        for option in word.split("/"):
            if option not in options:
                return f"no option {option}"
        taken = options[word.split("/")[0]]
        if not getattr(taken, "is_flag", False):
            value = next(rest, None)
            allowed = {"--method": PRESET_OF_METHOD, "--force": KINDS}.get(word)
            if allowed and value and not PLACEHOLDER.fullmatch(value) and value not in allowed:
                return f"{word} {value} is not known"
    if given > len(places) and not any(p.nargs == -1 for p in places):
        return f"{given} arguments, it takes {len(places)}"
    return ""


DOCUMENTS = sorted(
    path.relative_to(ROOT) for place in PLACES[:3] for path in ROOT.glob(place)
)  # *.md
FOLDERS = ("dfrf/", "dubbing/", "tests/", "docs/")
LONGEST_LINE = 120
MOST_LINES = {"README.md": 149, "docs/development/method.md": 199}
MOST_ROWS = {"docs/development/experiments.md": 149}
LONGEST_ROW = {"docs/development/experiments.md": 330}  # one decision, its main figures


def text_of(document: Path) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def named_paths(text: str) -> Iterator[str]:
    """Files and folders of the project that a document names as code."""
    for span in re.findall(r"`([^`\n]+)`", text):
        if span.startswith(FOLDERS) and re.fullmatch(r"[\w./-]+", span):
            yield span


def named_modules(text: str) -> Iterator[str]:
    """Modules named by the end of their path: `warp.py`, `field/warp.py`."""
    yield from re.findall(r"`((?:\w+/)*\w+\.py)`", text)


def named_places(text: str) -> Iterator[tuple[str, str]]:
    """A name and the file that it is said to be in: `warped` in `dfrf/field/warp.py`."""
    for names, path in re.findall(r"((?:`[^`\n]+`, )*`[^`\n]+`)\s+in\s+`([\w/]+\.py)`", text):
        for name in re.findall(r"`([\w.]+)(?:\([^`]*\))?`", names):
            yield name.split(".")[-1], path


def defined(name: str, path: Path) -> bool:
    """Whether a module defines a function, a class, a constant or an attribute of that name."""
    pattern = rf"^\s*(?:(?:def|class) {name}\b|(?:self\.)?{name}\b[^=\n]*[:=])"
    return re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE) is not None


def by_name(document: Path) -> str:
    return str(document)


@pytest.mark.parametrize("document", DOCUMENTS, ids=by_name)
def test_a_path_that_is_named_is_there(document: Path) -> None:
    text = text_of(document)
    assert not [path for path in named_paths(text) if not (ROOT / path).exists()]
    ours = [
        str(path)
        for package in ("dfrf", "dubbing", "tests")
        for path in ROOT.glob(f"{package}/**/*.py")
    ]
    lost = [n for n in named_modules(text) if not any(f"/{o}".endswith(f"/{n}") for o in ours)]
    assert not lost
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        assert (ROOT / document).parent.joinpath(target).exists(), target


def anchors(document: Path) -> set[str]:
    """Headings of a document, as a link names them."""
    headings = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", one).strip().lower().replace(" ", "-") for one in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=by_name)
def test_a_heading_that_is_linked_is_there(document: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#:\s]*)#([^)\s]*)\)", text_of(document)):
        place = (ROOT / document).parent / target if target else ROOT / document
        assert anchor in anchors(place), f"{target}#{anchor}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=by_name)
def test_a_name_is_defined_where_a_document_names_it(document: Path) -> None:
    for name, path in named_places(text_of(document)):
        assert defined(name, ROOT / path), f"no {name} in {path}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=by_name)
def test_a_document_is_narrow_and_no_longer_than_it_may_be(document: Path) -> None:
    lines = text_of(document).splitlines()
    wide = [n for n, line in enumerate(lines, 1) if len(line) > LONGEST_LINE]
    assert not [n for n in wide if not lines[n - 1].lstrip().startswith("|")]  # rows of tables
    assert len(lines) <= MOST_LINES.get(str(document), len(lines))
    rows = [line for line in lines if line.lstrip().startswith("|")]
    assert len(rows) <= MOST_ROWS.get(str(document), len(rows))
    longest = LONGEST_ROW.get(str(document))
    assert longest is None or max(map(len, rows)) <= longest


def test_what_a_document_names_is_found() -> None:
    """So that a change of the documents' style does not empty the tests above."""
    method = text_of(Path("docs/development/method.md"))
    assert len(list(named_paths(method))) > 30
    assert ("share_loss", "dfrf/fast/fast_loss.py") in set(named_places(method))
    assert not defined("warpe", ROOT / "dfrf/field/warp.py")
    assert list(named_modules("`field/warp.py` and `no.txt`")) == ["field/warp.py"]
    assert {Path("README.md"), Path("CONTRIBUTING.md"), Path("CHANGELOG.md")} < set(DOCUMENTS)


def test_enough_commands_are_found() -> None:
    """So that a change of the documents' style does not empty the tests below."""
    assert {c.words[1] for c in OURS} >= set(PROGRAM.commands)  # type: ignore[attr-defined]
    assert len(MODULES) >= 5
    assert len(TARGETS) >= 6
    assert len(EXTRAS) >= 2


@pytest.mark.parametrize("command", OURS, ids=named)
def test_a_call_of_the_tool_is_one_it_takes(command: Command) -> None:
    assert not wrong(command.words[1:])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("paint FILE", "no command paint"),
        ("dub MANIFEST --colour red", "no option --colour"),
        ("evaluate MANIFEST --method guess", "--method guess is not known"),
        ("dub MANIFEST --keep-going/--give-up", "no option --give-up"),
        ("prepare CLIP CLIP", "2 arguments, it takes 1"),
    ],
)
def test_a_call_it_does_not_take_is_found(call: str, message: str) -> None:
    assert wrong(tuple(call.split())) == message


@pytest.mark.parametrize("name", sorted({c.words[1] for c in OURS if c.words[1][0] != "-"}))
def test_every_command_explains_itself(name: str) -> None:
    result = CliRunner().invoke(app, [name, "--help"])
    assert result.exit_code == 0, result.output
    assert name in result.output


@pytest.mark.parametrize("command", MODULES, ids=named)
def test_a_module_that_is_run_takes_what_it_is_given(
    command: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, *arguments = command.words[2:]
    if module in ("pip", "pytest"):
        return
    monkeypatch.setattr(sys, "argv", [module, "--help"])
    importlib.import_module(module)
    monkeypatch.delitem(sys.modules, module)  # or runpy warns
    with pytest.raises(SystemExit) as end:
        runpy.run_module(module, run_name="__main__")
    assert not end.value.code
    known = set(re.findall(r"--[\w-]+", capsys.readouterr().out))
    assert {word for word in arguments if word.startswith("--")} <= known


@pytest.mark.parametrize("command", TARGETS, ids=named)
def test_a_target_is_in_the_makefile(command: Command) -> None:
    makefile = (ROOT / "Makefile").read_text()
    for word in command.words[1:]:
        variable, given, _ = word.partition("=")
        assert re.search(
            rf"\$\(.*{variable}\b|^{variable} .?=" if given else rf"^{word}:",
            makefile,
            re.MULTILINE,
        ), word


@pytest.mark.parametrize("command", OPTIONS, ids=named)
def test_an_option_alone_is_one_of_some_command(command: Command) -> None:
    known = {"--no-deps"}  # pip's
    for one in PROGRAM.commands.values():  # type: ignore[attr-defined]
        known.update(opt for p in one.params for opt in (*p.opts, *p.secondary_opts))
    options = {part for word in command.words[1:] for part in word.split("/")}
    assert {option for option in options if option.startswith("--")} <= known


@pytest.mark.parametrize("command", EXTRAS, ids=named)
def test_an_extra_is_declared(command: Command) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    for name in re.findall(r"dfrf\[(\w+)\]", " ".join(command.words)):
        assert name in extras


def test_the_first_commands_of_the_readme_run(tmp_path: Path) -> None:
    clips.write_clip(tmp_path / "host.mp4", 50)
    clips.write_sound(tmp_path / "host_it.wav", 1)
    run = CliRunner().invoke
    assert run(app, ["init", str(tmp_path)]).exit_code == 0
    path = tmp_path / "manifest.yaml"
    manifest = yaml_lines.read(path.read_text()).data
    manifest["identities"]["host"]["consent"] = {"by": "host", "reference": "form"}
    path.write_text(json.dumps(manifest))
    result = run(app, ["plan", str(path)])
    assert result.exit_code == 0, result.output
    assert run(app, ["doctor"]).exit_code in (0, 1)
