"""Numbers in words: one form, and the same number."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from deli.numerals import numeral
from deli.plotting.comparison import heat_map


@given(st.floats(-1e300, 1e300), st.integers(1, 17))
def test_a_numeral_is_the_number_to_its_digits(value, digits):
    text = numeral(value, digits)
    assert float(text) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits), abs=5e-324)
    assert "e+" not in text
    assert "e-0" not in text
    assert ".e" not in text


@pytest.mark.parametrize("exponent", range(-300, 301, 7))
def test_a_power_of_ten_has_one_form(exponent):
    for digits in (1, 3, 4, 9):
        expected = f"1e{exponent}" if exponent <= -3 or exponent >= 6 else f"{10.0**exponent:g}"
        if digits > exponent or exponent >= 6:
            assert numeral(10.0**exponent, digits) == expected


def study(values, states):
    tolerances = [1e-3, 1e-4, 1e-12]
    dims = ("solver", "tolerance")
    return xr.Dataset(
        {"energy_band": (dims, values), "state": (dims, states)},
        {"tolerance": tolerances, "solver": ["daqp", "osqp"]},
    )


@pytest.mark.parametrize("values", [np.ones((2, 3)), np.array([[0.0, 1e-4, 1.0], [1.0, 1e-12, 2.0]])])
@pytest.mark.parametrize("unfinished", ["done", "failed", "waiting", "excluded"])
def test_a_heat_map_has_a_key_for_what_has_no_colour(values, unfinished):
    states = np.full((2, 3), "done", dtype=object)
    states[1, 2] = unfinished
    axes = heat_map(study(values, states), "tolerance", "solver", "energy_band")
    legend = axes.get_legend()
    keys = [] if legend is None else [text.get_text() for text in legend.get_texts()]
    assert ("not done" in keys) == (unfinished in ("failed", "waiting"))
    assert ("zero" in keys) == bool((values == 0.0).any())
    assert [label.get_text() for label in axes.get_xticklabels()] == ["1e-3", "1e-4", "1e-12"]
    crossed = [patch for patch in axes.patches if patch.get_hatch()]
    assert bool(crossed) == ("not done" in keys)
