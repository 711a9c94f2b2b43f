"""Random projections onto polyhedra: rows, bounds, how many are equalities, and the wish."""

import numpy as np


def unit(rows):
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(lengths > 0.0, lengths, 1.0)


def feasible(random, rows, equalities):
    """Bounds that a point keeps, half of them exactly."""
    bounds = rows @ random.normal(size=rows.shape[1])
    loose = np.abs(random.normal(size=len(rows))) * (random.uniform(size=len(rows)) < 0.5)
    loose[:equalities] = 0.0
    return bounds - loose


def sizes(random):
    n, m = int(random.integers(1, 9)), int(random.integers(0, 13))
    return n, m, int(random.integers(0, min(m, 3) + 1))


def whole_numbers(random):
    n, m, e = sizes(random)
    rows = random.integers(-2, 3, (m, n)).astype(float)
    bounds = random.integers(-2, 2, m).astype(float)
    bounds[:e] = rows[:e] @ random.integers(-1, 2, n)
    return rows, bounds, e, random.integers(-3, 4, n).astype(float)


def cone(random):
    n, m, e = sizes(random)
    return random.integers(-1, 2, (m, n)).astype(float), np.zeros(m), e, random.integers(-3, 4, n).astype(float)


def general(random):
    n, m, e = sizes(random)
    rows = unit(random.normal(size=(m, n)))
    return rows, feasible(random, rows, e), e, 3.0 * random.normal(size=n)


def repeated(random):
    n, m, e = sizes(random)
    rows = unit(random.normal(size=(3, n)))[random.integers(0, 3, m)] * random.choice([1.0, 1.0, 2.0], (m, 1))
    return rows, feasible(random, rows, e), e, 3.0 * random.normal(size=n)


def rank_deficient(random):
    n, m, e = sizes(random)
    rank = max(1, n // 2)
    rows = unit(random.normal(size=(m, rank)) @ random.normal(size=(rank, n)))
    return rows, feasible(random, rows, e), e, 3.0 * random.normal(size=n)


KINDS = (whole_numbers, cone, general, repeated, rank_deficient)
