import pytest

from dubbing.batch.jobs import chosen_names
from dubbing.errors import ExplainedError

pytestmark = pytest.mark.medium


NAMES = ["shot1", "shot10", "shot1_it", "shot1_de", "shot10_it", "a[1]"]


@pytest.mark.parametrize(
    ("only", "chosen"),
    [
        ([], NAMES),
        (["shot1"], ["shot1"]),
        (["shot1_*"], ["shot1_it", "shot1_de"]),
        (["*_it", "shot1"], ["shot1", "shot1_it", "shot10_it"]),
        (["shot?_it"], ["shot1_it"]),
        (["a[1]"], ["a[1]"]),
    ],
)
def test_names_and_patterns(only: list[str], chosen: list[str]) -> None:
    assert chosen_names(only, NAMES) == set(chosen)


def test_a_pattern_that_fits_nothing_is_refused_with_some_of_the_names() -> None:
    with pytest.raises(ExplainedError, match=r"nothing is called x\*.*there is n0, n1") as caught:
        chosen_names(["n1", "x*"], [f"n{k}" for k in range(500)])
    assert len(str(caught.value)) < 300
