"""Settings that are refused say which, what is wrong, and what would be right."""

import re

import pytest

from cospeech.errors import ConfigError, require_choice, require_range


def test_a_value_is_one_of_the_choices():
    require_choice("model.seam", "cut", ("cut", "crossfade"))
    with pytest.raises(ConfigError, match=r"^model\.seam='glue' is not one of cut, crossfade$"):
        require_choice("model.seam", "glue", ("cut", "crossfade"))


@pytest.mark.parametrize(
    ("value", "most", "told"),
    [
        (0, None, "model.k=0: must be at least 1"),
        (9, 8, "model.k=9: must be from 1 to 8"),
        (float("nan"), None, "model.k=nan: must be at least 1"),
        (float("inf"), None, "model.k=inf: must be finite"),
    ],
)
def test_a_number_is_in_its_range(value, most, told):
    require_range("model.k", 1, 1, most)
    require_range("model.k", 8, 1, most)
    with pytest.raises(ConfigError, match=f"^{re.escape(told)}$"):
        require_range("model.k", value, 1, most)
