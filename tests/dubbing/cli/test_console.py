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
