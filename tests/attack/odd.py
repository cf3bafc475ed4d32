"""Odd values, odd names, and what can be done to data so that it is no longer as it should be."""

from __future__ import annotations

import copy
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st

from tests.attack.conftest import TIMES

NAMES = (
    *("", " ", ".", "..", "../it", "/etc/passwd", "a/b", "a\\b", "a:b", ".hidden", "-rf", "--help"),
    *("http:127.0.0.1:9", "tcp:127.0.0.1:9", "concat:a|b", "subfile,,start,0,end,9,,:it.wav"),
    *("[bold]a[/x]", "{{7*7}}", "%s%n", "$(touch x)", "<script>", "\x1b[31mred", "a\nb", "a\rb"),
    *(
        "\u202etxt.4pm",
        "é" * 60,
        "😀" * 60,
        "a" * 300,
        "\udcff",
        "CON",
        "nul",
        "a\0b",
        "~",
        "~root",
    ),
    *("~nobody-of-this-name/x", "*", "?", "[", "/dev/zero", "/dev/stdin", "/proc/self/mem", "true"),
    *(
        "it.wav/x",
        "ann.mp4",
        "manifest.yaml",
        ".",
        "out",
        "out/work",
        "out/work/stage.json",
        "💾.wav",
    ),
)
NUMBERS = (
    *(0, -1, 1, 2**31, 2**63, 2**64, 10**30, -(10**30), 1e308, -1e308, 5e-324, 0.1, 1e-9),
    *(float("nan"), float("inf"), float("-inf"), 10**4000, -0.0, 44100, 999999999),
)
names = st.sampled_from(NAMES) | st.text(max_size=12)
numbers = st.sampled_from(NUMBERS) | st.integers() | st.floats()
plain = st.none() | st.booleans() | numbers | names
values = st.recursive(
    plain,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=6,
)


def cases(usual: int) -> settings:
    """So many cases in the ordinary suite, as many times more as `make attack` asks for."""
    return settings(max_examples=usual * max(1, TIMES))


def places(data: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of all values in plain data, its own, (), among them."""
    found = [at]
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            found += places(value, (*at, key))
    return found


@st.composite
def spoilt(draw: st.DrawFn, whole: Any, most: int = 3) -> Any:
    """Plain data of which some values are gone, are others, have other names or too many layers."""
    data = copy.deepcopy(whole)
    for _ in range(draw(st.integers(1, most))):
        path = draw(st.sampled_from(places(data)))
        if not path:
            if draw(st.integers(0, 9)) == 0:
                return draw(values)
            continue
        inside = data
        for key in path[:-1]:
            inside = inside[key]
        act = draw(st.sampled_from(("replace", "replace", "delete", "rename", "wrap", "repeat")))
        key = path[-1]
        if act == "replace":
            inside[key] = draw(values)
        elif act == "wrap":
            for _ in range(draw(st.sampled_from((1, 2, 50)))):
                inside[key] = [inside[key]]
        elif act == "repeat" and isinstance(inside, list):
            inside.extend([copy.deepcopy(inside[key])] * draw(st.integers(1, 20)))
        elif act == "rename" and isinstance(inside, dict):
            inside[draw(names)] = inside.pop(key)
        else:
            del inside[key]
    return data


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """Bytes that were cut short, overwritten, repeated, or put behind something else."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(data)) | st.integers(0, min(200, len(data))))
        length = draw(st.sampled_from((1, 2, 4, 8, 64, 1000)))
        act = draw(st.sampled_from(("cut", "zero", "ones", "random", "repeat", "insert", "remove")))
        if act == "cut":
            del data[at:]
        elif act in ("zero", "ones"):
            data[at : at + length] = bytes([255 * (act == "ones")]) * len(data[at : at + length])
        elif act == "random":
            new = draw(st.binary(min_size=1, max_size=8))
            data[at : at + len(new)] = new
        elif act == "repeat":
            data[at:at] = data[at : at + length]
        elif act == "insert":
            data[at:at] = draw(st.binary(min_size=1, max_size=16))
        else:
            del data[at : at + length]
    return bytes(data)
