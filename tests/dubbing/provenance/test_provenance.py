import numpy as np
import pytest

from dubbing.provenance.provenance import SOURCE_TYPE, VisibleMark, statements, tags


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1080, 1920), (512, 512), (64, 48)])
def test_the_label_changes_its_corner_only(width: int, height: int) -> None:
    frame = np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)
    label = VisibleMark(width, height)
    marked = label.draw(frame)
    rows, columns = label.place
    assert rows.start >= height // 2 or height < 100
    changed = np.zeros((height, width), bool)
    changed[label.place] = True
    np.testing.assert_array_equal(marked[~changed], frame[~changed])
    assert (marked[changed] != frame[changed]).any(-1).mean() > 0.6
    assert marked[changed].size < 0.1 * marked.size or width < 100
    assert columns.stop <= width


@pytest.mark.parametrize("level", [0, 128, 255])
def test_the_letters_can_be_read_on_any_background(level: int) -> None:
    label = VisibleMark(1280, 720)
    part = label.draw(np.full((720, 1280, 3), level, np.uint8))[label.place].astype(int)
    assert part.max() - part.min() > 90
    assert np.ptp(part.mean((1, 2))) > 20  # there are lines of letters and lines without


def test_the_tags_state_that_the_picture_is_generated() -> None:
    assert "AI-generated" in tags()["comment"]
    assert "compositeWithTrainedAlgorithmicMedia" in tags()["comment"]


TERM = SOURCE_TYPE
OURS = tags()["comment"]


@pytest.mark.parametrize(
    ("key", "text", "counts"),
    [
        ("comment", "Shot on film. Nothing here is AI-generated.", False),
        ("comment", f"No {TERM} in it", False),
        ("comment", f"{OURS} is not true", False),
        ("comment", f"not an {OURS}", False),
        ("encoder", "dfrf 0.1.0", False),
        ("comment", OURS.replace("dfrf 0.", "dfrf 7."), True),
        ("description", OURS, True),
        ("DigitalSourceType", TERM, True),
        ("Iptc4xmpExt:DigitalSourceType", TERM.replace("compositeWithT", "t"), True),
        ("DigitalSourceType", TERM.replace("compositeWithT", "notT"), False),
        ("DigitalSourceType", TERM.rpartition("/")[0] + "/digitalCapture", False),
        ("DigitalSourceType", f"not {TERM}", False),
        ("DigitalSourceType", "trainedAlgorithmicMedia", True),
    ],
)
def test_only_what_says_so_counts_as_a_statement(key: str, text: str, counts: bool) -> None:
    found = statements({key: text, "title": "AI-generated"})
    assert found == ({key: text} if counts else {})
