"""What the benchmark counts; how long things take is not tested."""

import pytest
import torch
import torch.nn.functional as F

from dfrf.data.reference_cuts import cut_references
from dubbing.workshop.bench.benchmark import table
from dubbing.workshop.bench.timing import Row, flop_of, mean_row, whole_faces
from tests.dfrf.people import person

pytestmark = pytest.mark.medium


def test_flop_are_those_of_matrix_products() -> None:
    points, weight = torch.randn(100, 32), torch.randn(8, 32)
    assert flop_of(lambda: F.relu(F.linear(points, weight))) == 2 * 100 * 32 * 8


def test_frames_are_averaged_stage_by_stage() -> None:
    rows = [Row("march", 1.0, 10, "samples", 4e6), Row("march", 3.0, 20, "samples", 8e6)]
    assert mean_row(rows) == Row("march", 2.0, 15, "samples", 6e6)


def test_the_table_tells_pace_work_and_share() -> None:
    text = table([Row("field", 0.5, 1000, "samples", 2e9), Row("composite", 0.25)], rate=1e10)
    field, composite = text.splitlines()[1:]
    assert field.split() == ["field", "0.5000", "1,000", "samples", "2,000", "2.000", "40%"]
    assert composite.split() == ["composite", "0.2500"]


def test_the_published_model_is_shown_the_same_references() -> None:
    views = cut_references(person(), torch.tensor([0, 2, 5]))
    whole = whole_faces(views, 2)
    torch.testing.assert_close(whole.images * 255, views.images[:2].float())
    torch.testing.assert_close(whole.c2w, views.c2w[:2])
    torch.testing.assert_close(whole.centre, views.centres[:2])
    assert whole_faces(views, 4).images.shape[0] == 3
