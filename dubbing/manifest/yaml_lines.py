"""Safe YAML that remembers on which line every key stood."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import yaml

from dubbing.errors import Problem

Path = tuple[str | int, ...]
# What PyYAML raises at a value that is not of its kind, as the date 2026-13-45.
UNFIT = (ArithmeticError, AttributeError, LookupError, ValueError)
MOST_NODES = 100_000  # aliases can make a short file describe an endless tree


@dataclass
class Document:
    """Plain data, the line (from 1) of every key path in it, and what was wrong with the text."""

    data: Any = None
    lines: dict[Path, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def line(self, path: Path) -> int:
        """Line of ``path``, or of the nearest key above it."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)


def key_path(path: Path) -> str:
    """``identities.host.clip``, ``dubs[0].audio``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def read(text: str) -> Document:
    """Parse ``text``; broken syntax, unsafe tags and keys given twice become problems."""
    document = Document()
    try:
        loader = yaml.SafeLoader(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        said = f"not valid YAML: the character {chr(error.character)!r} is not allowed"
        document.problems.append(Problem(line, "", said))
        return document
    try:
        root = loader.get_single_node()
        if root is not None:
            document.data = _Builder(loader, document).build(root, ())
    except RecursionError:
        said = "not valid YAML: too many brackets in one another"
        document.problems.append(Problem(loader.line + 1, "", said))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        what = " ".join(part for part in (error.context, error.problem) if part)
        document.problems.append(Problem(line, "", f"not valid YAML: {what}"))
    finally:
        loader.dispose()
    return document


class _Builder:
    def __init__(self, loader: yaml.SafeLoader, document: Document) -> None:
        self.loader = loader
        self.document = document
        self.nodes = 0

    def build(self, node: yaml.Node, path: Path) -> Any:
        self.nodes += 1
        if self.nodes > MOST_NODES or len(path) > 50:
            raise yaml.constructor.ConstructorError(
                None, None, "too many or too deep aliases", node.start_mark
            )
        self.document.lines.setdefault(path, node.start_mark.line + 1)
        plain = "tag:yaml.org,2002:" + ("seq" if isinstance(node, yaml.SequenceNode) else "map")
        if isinstance(node, yaml.CollectionNode) and node.tag != plain:
            raise yaml.constructor.ConstructorError(
                None, None, f"the tag {node.tag} is not allowed", node.start_mark
            )
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*path, k)) for k, item in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        return self._constructed(node, path)

    def _constructed(self, node: yaml.Node, path: Path) -> Any:
        try:
            return self.loader.construct_object(node, deep=True)
        except UNFIT:
            kind = node.tag.removeprefix("tag:yaml.org,2002:")
            what = f"{node.value!r:.60} cannot be read as {kind}"
            raise yaml.constructor.ConstructorError(
                key_path(path), None, what, node.start_mark
            ) from None

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[Any, Any]:
        own: set[Any] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in own:
                    self._problem(key, (*path, key.value), "given twice")
                own.add(key.value)
        self.loader.flatten_mapping(node)
        data: dict[Any, Any] = {}
        for key, value in node.value:
            name = self._constructed(key, path)
            if not isinstance(name, str):
                self._problem(key, path, f"the key {key.value!r} is not text: put it in quotes")
                continue
            self.document.lines[(*path, name)] = key.start_mark.line + 1
            data[name] = self.build(value, (*path, name))
        return data

    def _problem(self, node: yaml.Node, path: Path, message: str) -> None:
        line = node.start_mark.line + 1
        self.document.problems.append(Problem(line, key_path(path), message))
