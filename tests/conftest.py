"""The order of tests: what takes minutes begins first, beside all the rest."""


def pytest_collection_modifyitems(items):
    """Notebooks are the long tail of a run on several cores otherwise."""
    items.sort(key=lambda item: "test_notebooks" not in item.nodeid)
