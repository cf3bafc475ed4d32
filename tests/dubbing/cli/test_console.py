"""What the commands print fits on a terminal."""

import pytest

from dubbing.cli import console

FIGURES = dict.fromkeys(("psnr", "ssim", "haarpsi", "psnr_face", "psnr_mouth", "lmd"), 0.5)


def test_figures_of_several_methods_are_readable_in_80_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "_width", 80)
    methods = dict.fromkeys(("dfrf", "dfrf-nowarp", "ad-nerf", "nerf"), FIGURES)
    console.metrics({"bob": {**methods, "dfrf": {**FIGURES, "lpips": 0.25, "frames": 7}}})
    shown = capsys.readouterr().out
    assert "…" not in shown
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines()]
    assert ["psnr_mouth", "0.500", "0.500", "0.500", "0.500"] in rows
    assert ["lpips", "0.250", "", "", ""] in rows
    assert ["frames", "7", "", "", ""] in rows


def rows_of(shown: str) -> list[list[str]]:
    """Cells of the tables that were printed."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines()]


def test_medians_over_people_and_what_is_suspicious(capsys: pytest.CaptureFixture[str]) -> None:
    def person(opening: float, **more: object) -> dict[str, dict[str, object]]:
        return {"dfrf": {"psnr": 30.0, **more, "p15x": {"opening_r": opening}}}

    why = "sync confidence 0.300 is above the source's own 0.200"
    console.metrics(
        {
            "ann": person(0.25),
            "bob": person(0.75, suspicious=True, suspicion=why, lag_ms=10.0),
            "eve": person(0.5, suspicious=False),
        }
    )
    shown = capsys.readouterr().out
    rows = rows_of(shown)
    assert [row for row in rows if row[:1] == ["p15x opening_r"]] == [
        ["p15x opening_r", figure] for figure in ("0.250", "0.750", "0.500", "0.500")
    ]
    assert ["suspicious", "yes"] in rows
    # A median is of those who have the figure, and of numbers only.
    behind = shown[shown.index("median of 3") :]
    assert ["lag_ms", "10.000"] in rows_of(behind)
    assert "suspicious" not in behind
    assert f"bob, dfrf: {why}" in shown
