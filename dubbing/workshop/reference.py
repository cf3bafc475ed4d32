"""`make docs`: the schema that ships, and the tables of docs/reference."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from dubbing.cli.main import app
from dubbing.engine.disk.files import atomic_write_text
from dubbing.manifest import schema
from dubbing.manifest.keys.consent_entry import Consent
from dubbing.manifest.keys.dub_entry import Credits, Dub, Label, Mark
from dubbing.manifest.keys.edit_entry import Edit, Key, Moved, Span, Take
from dubbing.manifest.keys.entry import Entry
from dubbing.manifest.keys.identity_entry import Colour, FacePoint, Finetune, Identity
from dubbing.manifest.keys.values import LONGEST_SECONDS

FOLDER = Path("docs/reference")
SCHEMA = Path(schema.__file__).with_name(schema.FILE)
BEGIN, END = "<!-- made by `make docs` -->", "<!-- end of what `make docs` made -->"
# Headings of the tables of keys, in their order.
ENTRIES: dict[type[Entry], str] = {
    Identity: "An identity",
    Consent: "consent",
    Colour: "colour",
    FacePoint: "face",
    Finetune: "finetune",
    Dub: "A dub",
    Edit: "edits",
    Key: "keys",
    Span: "film_mouth",
    Moved: "moved",
    Take: "takes",
    Label: "label",
    Credits: "credits",
    Mark: "mark",
}
ANCHORS = {model.__name__: heading for model, heading in ENTRIES.items()}
BY_ITSELF = ("clip", "name")  # required by the models; `clips` or a default does as well
OPTIONAL = ("timeline", "defaults", "dubs")  # sections
FORMATS = {"path": "path", "clock": "time as `1:05.5`", "date": "date as `2026-11-02`"}
WIDTH = 120
MANY = 10**6  # limits from here on only refuse nonsense


def manifest_tables() -> str:
    """Every key of a manifest: values, default, meaning."""
    whole = schema.build()
    rows = [
        f"| `{key}` | {_kind(part)} | {'' if key in OPTIONAL else '**required**'} "
        f"| {_cell(part['description'])} |"
        for key, part in whole["properties"].items()
    ]
    parts = ["## The whole\n", *_table(("key", "value", "default", "meaning"), rows)]
    for model, heading in ENTRIES.items():
        part = whole["$defs"][model.__name__]
        parts += [f"\n## {heading}\n", part["description"] + "\n"]
        rows = []
        for key, value in part["properties"].items():
            needed = model.model_fields[key].is_required() and key not in BY_ITSELF
            default = "**required**" if needed else _default(value)
            meaning = _cell(value["description"])
            rows.append(f"| `{key}` | {_kind(value)} | {default} | {meaning} |")
        parts += _table(("key", "value", "default", "meaning"), rows)
    return "\n".join(parts)


def command_tables() -> str:
    """Every command by its group: what it does, its arguments and options."""
    groups: dict[str, list[Any]] = {}
    for command in typer.main.get_command(app).commands.values():  # type: ignore[attr-defined]
        groups.setdefault(command.rich_help_panel, []).append(command)
    parts = []
    for group, commands in groups.items():
        parts.append(f"## {group}\n")
        for command in commands:
            places = [_value(p) for p in command.params if p.param_type_name == "argument"]
            parts += [f"### `dfrf {' '.join([str(command.name), *places])}`\n"]
            parts += [textwrap.fill(command.help or "", WIDTH) + "\n"]
            if rows := list(_parameters(command)):
                parts += [*_table(("argument or option", "default", "meaning"), rows), ""]
    return "\n".join(parts).rstrip()


def write(folder: Path) -> None:
    """Put the tables into the pages of a folder, between the two marks."""
    for page, tables in (("manifest.md", manifest_tables()), ("commands.md", command_tables())):
        text = (folder / page).read_text(encoding="utf-8")
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        atomic_write_text(folder / page, f"{before}{BEGIN}\n\n{tables}\n\n{END}{after}")


def _parameters(command: Any) -> Iterator[str]:
    for one in command.params:
        argument, flag = one.param_type_name == "argument", getattr(one, "is_flag", False)
        names = "" if argument else "/".join([*one.opts, *one.secondary_opts])
        written = names if flag else f"{names} {_value(one)}".strip()
        shown = isinstance(one.default, str | int | Path) and not flag
        default = "**required**" if one.required else f"`{one.default}`" if shown else ""
        yield f"| `{_cell(written)}` | {default} | {_cell(one.help or '')} |"


def _value(parameter: Any) -> str:
    """The word that stands for the value of an argument or option."""
    if parameter.metavar:
        return str(parameter.metavar)
    number = parameter.min is not None or isinstance(parameter.default, int)
    return "N" if number else parameter.opts[-1].strip("-").upper()


def _table(head: tuple[str, ...], rows: list[str]) -> list[str]:
    return [f"| {' | '.join(head)} |", "|---" * len(head) + "|", *rows]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _default(part: dict[str, Any]) -> str:
    """The default of a key; nothing where that is nothing."""
    default = part.get("default")
    if isinstance(default, dict):  # `true` in short, where that may be written
        default = True if {"type": "boolean"} in part.get("anyOf", ()) else None
    if default in (None, [], ""):
        return ""
    shown = {True: "true", False: "false"}[default] if isinstance(default, bool) else default
    return f"`{shown:g}`" if isinstance(shown, float) else f"`{shown}`"


def _kind(part: dict[str, Any]) -> str:  # noqa: PLR0911
    """In words what a key may hold."""
    several = [one for one in part.get("anyOf", part.get("allOf", ())) if one != {"type": "null"}]
    if several:
        return " or ".join(dict.fromkeys(map(_kind, several)))
    if "$ref" in part:
        heading = ANCHORS[part["$ref"].removeprefix(schema.DEFINITIONS)]
        return f"[{heading}](#{heading.lower().replace(' ', '-')})"
    if "enum" in part or "const" in part:
        return ", ".join(f"`{value}`" for value in part.get("enum", [part.get("const")]))
    kind = next(k for k in [part["type"]] * isinstance(part["type"], str) or part["type"])
    if kind == "object" and not part["additionalProperties"]:
        return "keys"
    if kind == "object":
        return f"mapping of names to {_kind(part['additionalProperties'])}"
    if kind == "array":
        return f"list of {_kind(part['items'])}"
    if kind == "string":
        return FORMATS.get(part.get("format", ""), "text")
    if kind == "number" and part.get("maximum") == LONGEST_SECONDS:
        return "seconds"
    return "`true`, `false`" if kind == "boolean" else kind + _limits(part)


def _limits(part: dict[str, Any]) -> str:
    low, high = part.get("minimum"), part.get("maximum", MANY)
    step = f" in steps of {part['multipleOf']}" if "multipleOf" in part else ""
    if low is None:
        words = f"above {part['exclusiveMinimum']}" if "exclusiveMinimum" in part else ""
        return f", {words}" + (f", at most {high}" if high < MANY else "") if words else ""
    return f", {low:g} to {high:g}{step}" if high < MANY else f", at least {low:g}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    write(parser.parse_args().folder)
    atomic_write_text(SCHEMA, schema.text())
