"""Recognises the speakers in the text of a script, by the ways in which names are set before words.

Names of the manifest are recognised. Other labels that look like names are noticed, too, so that
their words are not assigned to another person.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field

LONGEST = 60  # characters of a name with its addition
MOST_WORDS = 4  # of a name that the manifest does not know
MOST_ASIDES = 3  # brackets before a name
BAR = "|"  # as transcribers set a name off
COLONS = f":\uff1a\ufe55\ufe13\u2236\ua789{BAR}"
DASHES = "-\u2010\u2011\u2012\u2013\u2014\u2015\u2212"
LEADING = f"{DASHES}>\u203a\u2022*\u00b7"  # before the words of the next speaker
BRACKETS = {"[": "]", "(": ")", "\uff08": "\uff09", "\u3010": "\u3011", "\uff3b": "\uff3d"}
# Additions to a name: voice over, off screen, off camera, continued.
MARKS = {"vo", "os", "oc", "off", "over", "contd", "cont"}
ENDS, QUOTES = "[.!?\u2026]", r"[\"\u201d\u00bb)]"
SHORTENED = re.compile(r"(\w{1,4}\.)+")
SENTENCE_END = re.compile(rf"(?:(?<={ENDS})|(?<={ENDS}{QUOTES}))\s+(?=\S)")


class Names:
    """The names of a manifest, matched to names as a script writes them."""

    def __init__(self, names: Collection[str]) -> None:
        self._exact = set(names)
        self._alike: dict[str, set[str]] = {}
        for name in names:
            for key in {_key(name), _plain(_key(name))}:
                self._alike.setdefault(key, set()).add(name)

    def alike(self, written: str) -> set[str]:
        """The names that may be meant, by the nearest spelling, with or without an addition."""
        if written in self._exact:
            return {written}
        labels = _key(written), _key(_bare(written))
        keys = [key for label in labels for key in (label, _plain(label))]
        return next((self._alike[key] for key in keys if key in self._alike), set())

    def known(self, written: str) -> str:
        """The name in the manifest; '' if none matches, or several."""
        matches = self.alike(written)
        return next(iter(matches)) if len(matches) == 1 else ""

    def in_bracket(self, written: str) -> str:
        """The name in ``HOST`` or ``HOST, in Spanish``; '' if none matches, or several."""
        name, _, rest = written.partition(",")
        return self.known(written) or ("" if self.alike(rest.strip()) else self.known(name))


@dataclass
class Turn:
    """Words of one speaker. ``unsure``: another speaker than before, but unknown."""

    speaker: str
    rows: list[str] = field(default_factory=list)
    unsure: bool = False

    @property
    def words(self) -> str:
        """The rows joined to one."""
        return " ".join(" ".join(self.rows).split())


def turns(text: str, names: Names) -> list[Turn]:
    """The turns of speakers in the text of a cue; at least one."""
    parts = [Turn("")]
    rows = [row for row in _rows(text, names) if row]
    for place, row in enumerate(rows):
        more = place + 1 < len(rows)
        speaker, words = _named(row, names, more=more)
        bare = row.lstrip(f"{LEADING} ")
        marked = len(bare) < len(row) and row[0] in f"{DASHES}>\u203a"
        if speaker:
            parts.append(Turn(speaker, [words]))
        elif marked or (not parts[-1].rows and _may_name(bare, names, more=more)):
            parts.append(Turn("", [bare], unsure=True))
        else:
            parts[-1].rows.append(row)
    return [turn for turn in parts if turn.words] or parts[:1]


def is_sound(words: str) -> bool:
    """Whether a text describes sound or song instead of speech: ``(laughs)``, ``♪``."""
    text = words.strip()
    closed = BRACKETS.get(text[:1])
    alone = closed is not None and text.endswith(closed) and text.find(closed) == len(text) - 1
    return alone or text[:1] in ("\u266a", "\u266b", "#") or not any(map(str.isalnum, text))


def guessed(texts: Iterable[str]) -> set[str]:
    """Likely names in a script without a manifest: labels in capitals, or that occur repeatedly."""
    labels: Counter[str] = Counter()
    for text in texts:
        for row in _rows(text, Names(())):
            for label, form, words in _labels(row.lstrip(f"{LEADING} ")):
                if form in ("colon", "bracket") and words and _like_a_name(label):
                    labels[_bare(label)] += 1
                break
    return {label for label, count in labels.items() if count > 1 or label.isupper()}


def _rows(text: str, names: Names) -> Iterator[str]:
    """Rows of a text. ``>>`` starts one, and so does a name after the end of a sentence."""
    for row in text.replace(">>", "\n>>").replace(">>\n", ">>").split("\n"):
        begun: list[str] = []
        for piece in _sentences(row.strip(), names):
            if begun and _begins_turn(piece, names):
                yield " ".join(begun)
                begun = []
            begun.append(piece)
        yield " ".join(begun)


def _sentences(row: str, names: Names) -> Iterator[str]:
    """The sentences of a row. ``MR.`` or ``J.`` is none where it begins a name."""
    short: list[str] = []
    for piece in SENTENCE_END.split(row):
        if SHORTENED.fullmatch(piece.lstrip(f"{LEADING} ")):
            short.append(piece)
            continue
        wholes = {k: " ".join([*short[k:], piece]) for k in range(-MOST_WORDS, 0)}
        at = next((k for k, whole in wholes.items() if _begins_turn(whole, names)), len(short))
        yield from short[:at]
        yield " ".join([*short[at:], piece])
        short = []
    yield from short


def _begins_turn(text: str, names: Names) -> bool:
    """Whether a text begins with a name and a colon."""
    return any(
        form == "colon" and (_is_other(label) or bool(names.known(label)))
        for label, form, _ in _labels(text.lstrip(f"{LEADING} "))
    )


def _named(row: str, names: Names, *, more: bool) -> tuple[str, str]:
    """The speaker that a row names, as known or as written, and the words after it; else ''."""
    for _ in range(MOST_ASIDES):
        row = row.lstrip(f"{LEADING} ")
        labels = list(_labels(row))
        for label, form, words in labels:
            loud = label.isupper() or form in ("bracket", "marked")
            known = names.in_bracket(label) if form == "bracket" else names.known(label)
            if known and (words or more) and (form != "alone" or loud):
                return known, words
        for label, form, words in labels:
            if form in ("colon", "bracket") and (words or more) and _is_other(label):
                return _bare(label), words
        if not labels or labels[0][1] != "bracket":
            break
        row = labels[0][2]  # (laughs) ALBA: Good morning
    return "", ""


def _is_other(label: str) -> bool:
    """Whether a label is surely a name, though not one of the manifest."""
    return label.isupper() and _like_a_name(label)


def _may_name(row: str, names: Names, *, more: bool) -> bool:
    """Whether a row may start with an unknown name: ``Ben: Hello``."""
    for label, form, _ in _labels(row):
        if form == "colon" and (
            _like_a_name(label) or any(map(names.alike, [label, *label.split()]))
        ):
            return True
        if form == "alone" and more and _is_other(label):
            return True
    return False


def _labels(text: str) -> Iterator[tuple[str, str, str]]:
    """Possible names at the start of a row, how they are set off, and the words after them."""
    head = f"{text[:LONGEST]} "
    closing = BRACKETS.get(head[0])
    if closing and (end := head.find(closing)) > 1:
        yield (
            head[1:end].strip(f"{COLONS} "),
            "bracket",
            text[end + 1 :].lstrip(f"{COLONS}{DASHES} "),
        )
    colon = min((k for sign in COLONS if (k := head.find(sign)) > 0), default=0)
    is_clock = head[colon] != BAR and head[colon - 1].isdigit() and head[colon + 1].isdigit()
    if colon and not is_clock:
        yield head[:colon].strip(), "colon", text[colon + 1 :].strip()
    dash = next((k for k, c in enumerate(head) if c in DASHES and head[k + 1].isspace()), 0)
    if dash:
        yield head[:dash].strip().rstrip("."), "dash", text[dash + 1 :].strip()
    for opening, closing in BRACKETS.items():
        begin, end = head.find(opening), head.find(closing)
        if 0 < begin < end and set(_key(head[begin + 1 : end]).split()) <= MARKS:
            yield head[: end + 1], "marked", text[end + 1 :].lstrip(f"{COLONS}{DASHES} ")
    if len(text) <= LONGEST:
        yield text, "alone", ""


def _like_a_name(label: str) -> bool:
    """Whether it is a few words with capitals, without a sentence's punctuation."""
    words = _bare(label).split()
    return (
        0 < len(words) <= MOST_WORDS
        and not any(word[0].islower() for word in words)  # letters of many scripts have no case
        and any(map(str.isalpha, label))
        and not any(sign in label for sign in ",;!?\u2026")
    )


def _bare(label: str) -> str:
    """A name without its addition: ``(V.O.)``, ``, off``."""
    for opening in BRACKETS:
        if label.find(opening) > 0:
            label = label[: label.find(opening)]
    words = label.replace(",", " ").split()
    while len(words) > 1 and _key(words[-1]) in MARKS:
        words.pop()
    return " ".join(words)


def _key(name: str) -> str:
    """A name in the form for comparison: without case, points, quotes and invisible characters."""
    text = unicodedata.normalize("NFKC", name).casefold()
    kept = (c for c in text if unicodedata.category(c) != "Cf" and c not in ".'\u2019`")
    return unicodedata.normalize("NFC", " ".join("".join(kept).split()))


def _plain(key: str) -> str:
    """A key without accents, which capitals often lack."""
    letters = unicodedata.normalize("NFKD", key)
    return "".join(letter for letter in letters if not unicodedata.combining(letter))
