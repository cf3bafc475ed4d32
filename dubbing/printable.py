"""Text that is safe to print: a terminal would obey the control characters of a name."""

import unicodedata

KEPT = "\n\t"
# Control characters, halves of characters, and marks that turn the direction of what follows.
HIDDEN = ("Cc", "Cs", "Zl", "Zp")
TURNING = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def visible(text: str) -> str:
    """The text with control characters and the like written out, as in \\x1b; lines are kept."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_visible(letter) for letter in text)


def _visible(letter: str) -> str:
    if letter in KEPT or (unicodedata.category(letter) not in HIDDEN and letter not in TURNING):
        return letter
    return letter.encode("unicode_escape", errors="backslashreplace").decode("ascii")


def is_blank(text: str) -> bool:
    """Whether nothing in it can be read: no letter and no digit."""
    return not any(unicodedata.category(c)[0] in "LN" and c not in FILLERS for c in text)


FILLERS = frozenset("\u115f\u1160\u3164\uffa0")  # letters by name, drawn as nothing
