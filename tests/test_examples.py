"""Each public name has an example, and each example gives the output that it shows."""

import doctest
import inspect
import sys

import pytest

import deli
import solvers

PACKAGES = (deli, deli.impacts, deli.metrics, deli.plotting, deli.scenes, solvers)


def is_exemplary(thing):
    return inspect.isclass(thing) or inspect.isroutine(thing)


PUBLIC = {
    f"{package.__name__}.{name}": getattr(package, name)
    for package in PACKAGES
    for name in package.__all__
    if is_exemplary(getattr(package, name))
}


@pytest.fixture
def options(request):
    names = request.config.getini("doctest_optionflags")
    return sum(doctest.OPTIONFLAGS_BY_NAME[name] for name in names)


@pytest.fixture
def no_figures():
    """Figures are closed after an example, because pyplot keeps them."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.mark.parametrize("name", PUBLIC)
def test_the_examples_of_a_public_name_give_the_output_that_they_show(name, options, no_figures, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    docstrings = doctest.DocTestFinder(exclude_empty=False).find(PUBLIC[name], name, module=False, globs={})
    assert docstrings[0].examples, f"the docstring of {name} has no example"  # those of methods come behind it
    runner = doctest.DocTestRunner(optionflags=options)
    report = []
    for docstring in docstrings:
        runner.run(docstring, out=report.append)
    assert not report, "".join(report)
