"""What a terminal would take for an order is written out."""

import pytest

from dubbing.printable import is_blank, visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain", "plain"),
        ("é 漢 😀", "é 漢 😀"),
        ("two\nlines\t.", "two\nlines\t."),
        ("\x1b[31m\r\x07\x9b", r"\x1b[31m\r\x07\x9b"),
        ("a\u202eb\u2028", r"a\u202eb\u2028"),
        ("\udcff", r"\udcff"),
    ],
)
def test_controls_are_written_out(text: str, shown: str) -> None:
    assert visible(text) == shown


@pytest.mark.parametrize("text", ["", " \t", "\u200b\u200d", "\x07", "\u3164", "--", "\u2800"])
def test_nothing_to_read(text: str) -> None:
    assert is_blank(text)


@pytest.mark.parametrize("text", ["A", "7", "漢", "\u200bé"])
def test_something_to_read(text: str) -> None:
    assert not is_blank(text)
