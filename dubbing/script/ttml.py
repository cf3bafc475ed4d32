"""Reads timed text (TTML, IMSC, DFXP): paragraphs with times in seconds or frames, and agents."""

import re
from collections.abc import Iterator
from fractions import Fraction
from typing import Any
from xml.etree import ElementTree

from dubbing.script.line import UNNUMBERED, Line, OtherKindError
from dubbing.script.timecode import frame_of

NAMESPACE, KINDS = "{http://www.w3.org/", ("ttml", "ttaf1")
XML = "{http://www.w3.org/XML/1998/namespace}"
CLOCK = re.compile(
    r"([0-9]{2,4}):([0-9]{2}):([0-9]{2}(?:\.[0-9]{1,9})?)(?::([0-9]{2,4})(?:\.[0-9]{1,9})?)?"
)
OFFSET = re.compile(r"([0-9]{1,12}(?:\.[0-9]{1,12})?)(h|m|s|ms|f|t)")
NUMBER = re.compile(r"[0-9]{1,9}(?:\.[0-9]{1,9})?")
SPOKEN = ("div", "p", "span")
FASTEST = 1000  # frames a second
DEEPEST = 50  # elements in one another


def read(text: str, _rate: Fraction) -> list[Line]:
    """The paragraphs of a document that have times. The document has its own frame rate.

    Raises:
        ValueError: it is no TTML, declares entities, or a time in it cannot be read.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("it declares entities, which no timed text needs")
    try:
        root = _parsed(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is no XML: {error}") from error
    if _tag(root) != "tt":
        raise OtherKindError("it is no timed text: its root is not <tt>")
    document = _Document(root)
    body = next((child for child in root if _tag(child) == "body"), None)
    if body is not None:
        document.walk(body, Fraction(0), None, "")
    return document.lines


def _parsed(text: str) -> ElementTree.Element:
    parser = ElementTree.XMLPullParser(("start", "end"))  # type: ignore[var-annotated]
    parser.feed(text)
    depth = 0
    root: Any = None
    for event, element in parser.read_events():  # type: ignore[misc]
        root = element if root is None else root
        depth += 1 if event == "start" else -1
        if depth > DEEPEST:
            raise ValueError("its elements lie too deep in one another")
    parser.close()
    if root is None:
        raise ValueError("it is no timed text: it is empty")
    document: ElementTree.Element = root
    return document


class _Document:
    """A document: its frame rate and tick rate, its agents, and the lines read so far."""

    def __init__(self, root: ElementTree.Element) -> None:
        rate = _number(_attribute(root, "frameRate") or "30")
        written = _attribute(root, "frameRateMultiplier") or "1 1"
        times = written.replace(":", " ").split()
        if len(times) not in (1, 2) or not _number(times[-1]) > 0:
            raise ValueError("its frameRateMultiplier is none")
        if times == ["999", "1000"]:
            times = ["1000", "1001"]  # as iTunes Timed Text means it
        self.rate = rate * _number(times[0]) / (_number(times[1]) if len(times) > 1 else 1)
        self.ticks = _number(_attribute(root, "tickRate") or "1")
        if not 1 <= self.rate <= FASTEST or self.ticks < 1:
            raise ValueError("its frame rate or tick rate is none")
        self.counts_frames = _attribute(root, "timeBase") == "smpte"
        self.drops = _attribute(root, "dropMode") not in ("", "nonDrop")
        self.agents: dict[str, str] = {}
        for agent in (e for e in root.iter() if _tag(e) == "agent"):
            names = ["".join(child.itertext()).strip() for child in agent if _tag(child) == "name"]
            self.agents[agent.get(f"{XML}id", "")] = next(filter(None, names), "")
        self.lines: list[Line] = []

    def walk(
        self, element: ElementTree.Element, begin: Fraction, end: Fraction | None, agent: str
    ) -> None:
        """Add the lines of an element; its times count from those of its parent."""
        start, stop = begin, end
        if (written := element.get("begin")) is not None:
            start = begin + self.seconds(written)
        if (written := element.get("dur")) is not None:
            stop = start + self.seconds(written)
        elif (written := element.get("end")) is not None:
            stop = begin + self.seconds(written)
        agent = _attribute(element, "agent") or agent
        timed = stop is not None and (stop != end or start != begin)
        if _tag(element) in ("p", "span") and timed and _words(element):
            assert stop is not None
            self._add(element, start, stop, agent)
            return
        if _tag(element) == "p" and start != begin and _words(element) and not _timed(element):
            raise ValueError(f"the paragraph at {float(start):g} s has no end")
        for child in element:
            if _tag(child) in SPOKEN:
                self.walk(child, start, stop, agent)

    def _add(
        self, element: ElementTree.Element, start: Fraction, stop: Fraction, agent: str
    ) -> None:
        """Add a paragraph; one with several agents becomes a line for each of them."""
        parts: dict[str, list[str]] = {}
        for whose, words in _said(element, agent):
            parts.setdefault(self.agents.get(whose) or whose, []).append(words)
        named = {name: "".join(words) for name, words in parts.items()}
        spoken = {name: words for name, words in named.items() if words.strip()}
        number = _digits(element.get(f"{XML}id", ""))
        several = len(spoken) > 1
        self.lines += [
            Line(number, start, stop, name, words, self.counts_frames, several, drops=self.drops)
            for name, words in spoken.items()
        ]

    def seconds(self, text: str) -> Fraction:
        """Seconds of a time expression.

        Raises:
            ValueError: it is none.
        """
        if match := OFFSET.fullmatch(text.strip()):
            unit = {
                "h": Fraction(3600),
                "m": Fraction(60),
                "s": Fraction(1),
                "ms": Fraction(1, 1000),
                "f": 1 / self.rate,
                "t": 1 / self.ticks,
            }
            return Fraction(match[1]) * unit[match[2]]
        match = CLOCK.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"{text!r:.40} is no time as 00:01:05.5 or 00:01:05:12")
        if self.counts_frames:
            frames = int(match[4] or 0)
            sign = ";" if self.drops else ":"
            code = f"{match[1]}:{match[2]}:{match[3][:2]}{sign}{frames:02d}"
            return frame_of(code, self.rate) / self.rate
        whole = 3600 * int(match[1]) + 60 * int(match[2]) + Fraction(match[3])
        return whole + int(match[4] or 0) / self.rate


def _tag(element: ElementTree.Element) -> str:
    return _name(str(element.tag))


def _name(tag: str) -> str:
    """A name without its namespace, if that is one of timed text. Long names are not copied."""
    ours = tag.startswith(NAMESPACE) and any(kind in tag[:100] for kind in KINDS)
    return tag[tag.rfind("}") + 1 :] if ours else tag


def _number(text: str) -> Fraction:
    if not NUMBER.fullmatch(text.strip()):
        raise ValueError(f"{text!r:.40} is no number as 25 or 23.976")
    return Fraction(text.strip())


def _digits(name: str) -> int:
    """The number at the end of an identifier as ``c12``; UNNUMBERED without one."""
    digits = name[len(name.rstrip("0123456789")) :]
    return int(digits) if 0 < len(digits) < 10 else UNNUMBERED


def _attribute(element: ElementTree.Element, name: str) -> str:
    """The value of an attribute in any of timed text's namespaces."""
    return next((v for k, v in element.items() if _name(k) == name), "")


def _said(element: ElementTree.Element, agent: str) -> Iterator[tuple[str, str]]:
    """The words of an element with their agent; ``<br/>`` starts a row."""
    agent = _attribute(element, "agent") or agent
    yield agent, "\n" if _tag(element) == "br" else ""
    if _tag(element) != "metadata":
        yield agent, element.text or ""
        for child in element:
            yield from _said(child, agent)
            yield agent, child.tail or ""


def _timed(element: ElementTree.Element) -> bool:
    """Whether parts of an element have times of their own."""
    return any(part.get("begin") for part in element.iter() if part is not element)


def _words(element: ElementTree.Element) -> str:
    return " ".join(" ".join(words for _, words in _said(element, "")).split())
