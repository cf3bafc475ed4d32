"""Safe YAML that remembers on which line every key stood."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.nodes import CollectionNode, MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from dubbing.engine.disk.files import read_text
from dubbing.errors import ExplainedError, Problem

KeyPath = tuple[str | int, ...]
# What ruamel.yaml raises at a value that is not of its kind, as the date 2026-13-45.
UNFIT = (ArithmeticError, AttributeError, LookupError, ValueError)
MOST_NODES = 100_000  # aliases can make a short file describe an endless tree
DEEPEST = 50
LONGEST_VALUE = 100  # characters of what is no text: a number of a million digits takes hours
MERGE, TEXT = "tag:yaml.org,2002:merge", "tag:yaml.org,2002:str"


@dataclass
class Document:
    """Plain data, the line (from 1) of every key path in it, and what was wrong with the text."""

    data: Any = None
    lines: dict[KeyPath, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def line(self, path: KeyPath) -> int:
        """Line of ``path``, or of the nearest key above it."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)


def key_path(path: KeyPath) -> str:
    """``identities.host.clip``, ``dubs[0].audio``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def quoted(text: str) -> str:
    """A string that YAML reads back as it is: JSON's strings are YAML's."""
    return json.dumps(text, ensure_ascii=False)


def read_file(path: Path, most: int) -> Document:
    """Read a file of at most so many bytes.

    Raises:
        ValueError: it cannot be read.
    """
    try:
        return read(read_text(path, most))
    except (OSError, ValueError, ExplainedError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"cannot be read: {reason}") from error


def read(text: str) -> Document:
    """Parse ``text``; broken syntax, unsafe tags and keys given twice become problems."""
    document = Document()
    parser = YAML(typ="safe", pure=True)  # YAML 1.2: `no` and 1:05 are text
    parser.Composer = _Composer
    parser.composer.warn_double_anchors = False  # in YAML 1.2 the last one counts
    try:
        root = parser.compose(text)
        if root is not None:
            document.data = _Builder(parser.constructor, document).build(root, ())
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        what = f"not valid YAML: the character {chr(error.character)!r} is not allowed"
        document.problems.append(Problem(line, "", what))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        what = " ".join(part for part in (error.context, error.problem) if part)
        document.problems.append(Problem(line, "", f"not valid YAML: {what}"))
    return document


class _Composer(Composer):
    """Reads no more and no deeper nodes than are built of them."""

    read = 0

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        self.read += 1
        if self.read > MOST_NODES or self.depth > DEEPEST:
            many = self.read > MOST_NODES
            what = "too many values" if many else "too many brackets in one another"
            raise MarkedYAMLError(None, None, what, self.parser.peek_event().start_mark)
        return super().compose_node(parent, index)


class _Builder:
    def __init__(self, constructor: SafeConstructor, document: Document) -> None:
        self.constructor = constructor
        self.document = document
        self.nodes = 0

    def build(self, node: Node, path: KeyPath) -> Any:
        self._count(node, 1, len(path))
        self.document.lines.setdefault(path, node.start_mark.line + 1)
        plain = "tag:yaml.org,2002:" + ("seq" if isinstance(node, SequenceNode) else "map")
        if isinstance(node, CollectionNode) and node.tag != plain:
            raise MarkedYAMLError(None, None, f"the tag {node.tag} is not allowed", node.start_mark)
        if isinstance(node, SequenceNode):
            return [self.build(item, (*path, k)) for k, item in enumerate(node.value)]
        if isinstance(node, MappingNode):
            return self._mapping(node, path)
        assert isinstance(node, ScalarNode)
        return self._constructed(node, path)

    def _count(self, node: Node, more: int, depth: int) -> None:
        self.nodes += more
        if self.nodes > MOST_NODES or depth > DEEPEST:
            raise MarkedYAMLError(None, None, "too many or too deep aliases", node.start_mark)

    def _constructed(self, node: ScalarNode, path: KeyPath) -> Any:
        try:
            if node.tag != TEXT and len(node.value) > LONGEST_VALUE:
                raise ValueError
            value = self.constructor.construct_object(node, deep=True)
            if isinstance(value, str):
                value.encode()  # half a character, as "\ud800", is none
            return value
        except UNFIT:
            kind = str(node.tag).removeprefix("tag:yaml.org,2002:")
            what = f"{node.value!r:.60} cannot be read as {kind}"
            raise MarkedYAMLError(key_path(path), None, what, node.start_mark) from None

    def _mapping(self, node: MappingNode, path: KeyPath) -> dict[Any, Any]:
        own: set[Any] = set()
        for key, _ in node.value:
            if isinstance(key, ScalarNode):
                if key.value in own:
                    self._problem(key, (*path, key.value), "given twice")
                own.add(key.value)
        data: dict[Any, Any] = {}
        for key, value in self._pairs(node, 0):
            if not isinstance(key, ScalarNode):
                self._problem(key, path, "a key is not text")
                continue
            name = self._constructed(key, path)
            if not isinstance(name, str):
                what = f"the key {key.value!r:.60} is not text: put it in quotes"
                self._problem(key, path, what)
                continue
            self.document.lines[(*path, name)] = key.start_mark.line + 1
            data[name] = self.build(value, (*path, name))
        return data

    def _pairs(self, node: MappingNode, depth: int) -> list[tuple[Node, Node]]:
        """Keys and values: first those that it merges (``<<``), then its own, which overrule them.

        The parser would put merged keys in place before they can be counted, a power of them where
        mappings merge one another.
        """
        self._count(node, 1, depth)  # first of all: one may merge itself
        merged: list[tuple[Node, Node]] = []
        own = []
        for key, value in node.value:
            if key.tag != MERGE:
                own.append((key, value))
                continue
            others = value.value if isinstance(value, SequenceNode) else [value]
            for other in reversed(others):  # the first overrules the others
                if not isinstance(other, MappingNode):
                    raise MarkedYAMLError(None, None, "only mappings can be merged", key.start_mark)
                merged += self._pairs(other, depth + 1)
        self._count(node, len(merged), depth)
        return merged + own

    def _problem(self, node: Node, path: KeyPath, message: str) -> None:
        line = node.start_mark.line + 1
        self.document.problems.append(Problem(line, key_path(path), message))
