"""Timed text (TTML, IMSC, DFXP): paragraphs with times, which may count frames, and agents."""

import re
from fractions import Fraction
from xml.etree import ElementTree

from dubbing.script.line import Line
from dubbing.script.timecode import frame_of

NAMESPACE = re.compile(r"\{http://www\.w3\.org/[^}]*ttml?[^}]*\}")
PARAMETER = "{http://www.w3.org/ns/ttml#parameter}"
IDENTIFIER = "{http://www.w3.org/XML/1998/namespace}id"
CLOCK = re.compile(r"(\d{2,}):(\d{2}):(\d{2}(?:\.\d+)?)(?::(\d{2,})(?:\.\d+)?)?")
OFFSET = re.compile(r"(\d+(?:\.\d+)?)(h|m|s|ms|f|t)")
SPOKEN = ("div", "p", "span")


def read(text: str, _rate: Fraction, start: int) -> list[Line]:
    """The paragraphs of a document that have times. The document has its own frame rate.

    Raises:
        ValueError: it is no TTML, declares entities, or a time in it cannot be read.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("it declares entities, which no timed text needs")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is no XML: {error}") from error
    if _tag(root) != "tt":
        raise ValueError("it is no timed text: its root is not <tt>")
    body = next((child for child in root if _tag(child) == "body"), None)
    try:
        document = _Document(root, start)
        if body is not None:
            document.walk(body, Fraction(0), None, "")
    except (ZeroDivisionError, IndexError) as error:
        raise ValueError("its frame rate or tick rate is none") from error
    except RecursionError as error:
        raise ValueError("its elements lie too deep in one another") from error
    return document.lines


class _Document:
    """Its clock, its agents, and the lines found so far."""

    def __init__(self, root: ElementTree.Element, first: int) -> None:
        self.first = first  # frame of the film's first timecode
        rate = Fraction(root.get(f"{PARAMETER}frameRate", "30"))
        times = root.get(f"{PARAMETER}frameRateMultiplier", "1 1").replace(":", " ").split()
        self.rate = rate * Fraction(int(times[0]), int(times[-1]))
        self.ticks = Fraction(root.get(f"{PARAMETER}tickRate", "1"))
        self.counts_frames = root.get(f"{PARAMETER}timeBase") == "smpte"
        self.drops = root.get(f"{PARAMETER}dropMode", "nonDrop") != "nonDrop"
        self.agents: dict[str, str] = {}
        for agent in (e for e in root.iter() if _tag(e) == "agent"):
            names = ["".join(child.itertext()).strip() for child in agent if _tag(child) == "name"]
            self.agents[agent.get(IDENTIFIER, "")] = next(filter(None, names), "")
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
        if _tag(element) in ("p", "span") and timed and (words := _words(element)):
            assert stop is not None
            speaker = self.agents.get(agent) or agent or _only_agent(element, self.agents)
            self.lines.append(Line(len(self.lines) + 1, start, stop, speaker, words))
            return
        for child in element:
            if _tag(child) in SPOKEN:
                self.walk(child, start, stop, agent)

    def seconds(self, text: str) -> Fraction:
        """Seconds of a time expression.

        Raises:
            ValueError: it is none.
        """
        if found := OFFSET.fullmatch(text.strip()):
            unit = {
                "h": Fraction(3600),
                "m": Fraction(60),
                "s": Fraction(1),
                "ms": Fraction(1, 1000),
                "f": 1 / self.rate,
                "t": 1 / self.ticks,
            }
            return Fraction(found[1]) * unit[found[2]]
        found = CLOCK.fullmatch(text.strip())
        if found is None:
            raise ValueError(f"{text!r:.40} is no time as 00:01:05.5 or 00:01:05:12")
        if self.counts_frames:
            frames = int(found[4] or 0)
            sign = ";" if self.drops else ":"
            code = f"{found[1]}:{found[2]}:{found[3][:2]}{sign}{frames:02d}"
            frame = frame_of(code, self.rate)
            return (frame - self.first if frame >= self.first else frame) / self.rate
        whole = 3600 * int(found[1]) + 60 * int(found[2]) + Fraction(found[3])
        return whole + int(found[4] or 0) / self.rate


def _tag(element: ElementTree.Element) -> str:
    return NAMESPACE.sub("", str(element.tag))


def _attribute(element: ElementTree.Element, name: str) -> str:
    """The value of an attribute in any of timed text's namespaces."""
    return next((v for k, v in element.items() if NAMESPACE.sub("", k) == name), "")


def _only_agent(element: ElementTree.Element, agents: dict[str, str]) -> str:
    """The agent named inside a paragraph, where its parts name one and the same."""
    named = {_attribute(e, "agent") for e in element.iter()} - {""}
    only = named.pop() if len(named) == 1 else ""
    return agents.get(only) or only


def _words(element: ElementTree.Element) -> str:
    return " ".join(" ".join(element.itertext()).split())
