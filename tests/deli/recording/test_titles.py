"""Titles of runs: they say every setting that means something, and no other."""

import itertools

import pytest

import deli
from deli.errors import InputError
from deli.integrators.registry import METHODS
from deli.recording.provenance import describe, title

METHOD_NAMES = sorted(METHODS)


def title_of(method):
    settings = {"step_size": 0.1, "steps": 2, "every": 1, "solvers": "auto"}
    return title(describe(deli.scenes.newtons_cradle(), method, **settings)).split(", h = ")[0]


def possible(kind, **settings):
    try:
        return kind(**settings)
    except InputError:
        return None


@pytest.mark.parametrize("name", METHOD_NAMES)
def test_a_choice_is_said_where_there_is_another(name):
    kind = METHODS[name]
    combinations = [
        dict(zip(kind.CHOICES, values, strict=True)) for values in itertools.product(*kind.CHOICES.values())
    ]
    for settings in combinations:
        if (method := possible(kind, **settings)) is None:
            continue
        words = title_of(method).removesuffix(")").partition("(")[2].split(", ")
        for key, value in settings.items():
            others = [other for other in kind.CHOICES[key] if other != value]
            free = any(possible(kind, **settings | {key: other}) for other in others)
            said = value if isinstance(value, str) else f"{key} = {value}"
            assert (said in words) == (free or value != getattr(kind, key)), (settings, words)
