"""Large programs handed over sparse: the answers of the dense model, whatever the pattern and however dependent."""

import numpy as np
import pytest
from scipy import sparse

import deli
import solvers
from deli.kernels.program import Program
from deli.subproblems import position, program
from deli.subproblems.choices import SolverChoice
from deli.subproblems.program import ProgramSolver
from deli.subproblems.stats import StepStats

SIZE, FREE = 180, 160
SPARSE = pytest.mark.parametrize("backend", solvers.able("sparse"))


def projection(seed: int, repeated: int = 0) -> tuple[Program, int]:
    """A projection in the layout of kernels, and how many of its rows are equalities, `repeated` of them copies."""
    random = np.random.default_rng(seed)
    matrix = np.zeros((40 + repeated + FREE, SIZE))
    for row in matrix:
        row[random.choice(SIZE, 4, replace=False)] = random.normal(size=4)
    matrix[40 : 40 + repeated] = -matrix[:repeated]
    matrix /= np.linalg.norm(matrix, axis=1)[:, np.newaxis]
    bounds = matrix @ random.normal(size=SIZE)
    bounds[40 + repeated :] -= np.abs(random.normal(size=FREE)) * random.integers(0, 2, FREE)
    rows = sparse.csr_array(matrix)
    column, value = rows.indices.astype(np.int64), rows.data
    for begin, end in zip(rows.indptr, rows.indptr[1:], strict=False):  # kernels keep no order within a row
        shuffled = begin + random.permutation(end - begin)
        column[begin:end], value[begin:end] = column[shuffled], value[shuffled]
    given = {"start": rows.indptr.astype(np.int64), "column": column, "value": value, "bounds": bounds}
    given |= {"wish": random.normal(size=SIZE), "z": np.zeros(SIZE), "y": np.zeros(len(matrix))}
    unused = dict.fromkeys(("lengths", "white_value", "gram", "right", "pull", "report"), np.zeros(0))
    unused |= dict.fromkeys(("metric", "factor"), np.zeros((0, 0)))
    unused |= dict.fromkeys(("white_start", "white_column", "begins", "factored"), np.zeros(0, dtype=np.int64))
    return Program(**given, **unused), 40 + repeated


def solver_for(given: Program, **choice: object) -> ProgramSolver:
    return ProgramSolver(1, position.model, position.newton_model, given, SolverChoice(**choice), StepStats())


def answer(solver: ProgramSolver, given: Program, equalities: int) -> np.ndarray:
    solver.bind(given)
    solver.solve(SIZE, equalities, given.bounds.size, False)
    return given.z.copy()


@SPARSE
@pytest.mark.parametrize("repeated", [0, 25])
def test_sparse_and_dense_answers_agree(backend: str, repeated: int, monkeypatch: pytest.MonkeyPatch) -> None:
    given, equalities = projection(0, repeated)
    found = answer(solver_for(given, backend=backend), given, equalities)
    matrix = sparse.csr_array((given.value, given.column, given.start), shape=(given.bounds.size, SIZE))
    slack = matrix @ found - given.bounds
    assert np.abs(slack[:equalities]).max() < 1e-12
    assert slack.min() > -1e-12
    np.testing.assert_allclose(found - given.wish, matrix.T @ given.y, rtol=0, atol=1e-12)
    assert given.y[equalities:].min() >= 0.0
    assert np.abs(given.y[equalities:] * slack[equalities:]).max() < 1e-12
    monkeypatch.setattr(program, "LARGEST_DENSE", given.bounds.size)
    np.testing.assert_allclose(answer(solver_for(given, backend=backend), given, equalities), found, rtol=0, atol=1e-9)


def test_of_equalities_that_depend_on_each_other_the_first_ones_are_handed_over() -> None:
    given, equalities = projection(0, repeated=25)
    _, kept = solver_for(given, backend="daqp").pose(SIZE, equalities, given.bounds.size, False)
    np.testing.assert_array_equal(kept, range(40))


@SPARSE
def test_patterns_leave_no_trace(backend: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Problems are compiled once for each of the last patterns, and answers are functions of the data, bit for bit."""
    compiled = []
    compile = solvers.compile
    monkeypatch.setattr(solvers, "compile", lambda *args, **options: compiled.append(1) or compile(*args, **options))
    cases = [projection(seed, repeated=seed % 2) for seed in range(program.PATTERNS + 1)]
    used = solver_for(cases[0][0], backend=backend)
    first = [answer(used, *case) for case in cases]
    assert len(compiled) == len(cases)
    again = [answer(used, *case) for case in reversed(cases)][::-1]
    assert len(compiled) == len(cases) + 1  # the first pattern had been dropped
    for case, one, other in zip(cases, first, again, strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, answer(solver_for(case[0], backend=backend), *case))


@SPARSE
def test_a_chain_slides_alike_with_every_backend(backend: str) -> None:
    scene = deli.scenes.chain_on_cylinder(masses=90)
    states = []
    for choice in ("daqp", backend):
        stepper, state = deli.GVI().stepper(scene, 0.002, solvers=choice), (scene.position, scene.momentum)
        for _ in range(2):
            state = stepper.step(*state)
        assert stepper.backends == {choice}
        stats = stepper.stats
        assert stats.rows[1] > program.LARGEST_DENSE
        assert stats.solves[1] >= 2
        np.testing.assert_array_equal(stats.verified, stats.solves)
        assert (stats.claimed <= stats.solves).all()
        states.append(np.concatenate(state))
    np.testing.assert_allclose(states[1], states[0], rtol=0, atol=1e-9)


def rest(steps: int, **choice: object) -> tuple[np.ndarray, np.ndarray]:
    """States of a pile of 271 closed contacts, and iterations by step."""
    scene = deli.scenes.disc_pile(rows=5, columns=20)
    stepper = deli.GVI().stepper(scene, 0.01, solvers=choice)
    states, iterations = [(scene.position, scene.momentum)], []
    for _ in range(steps):
        stepper.stats.reset()
        states.append(stepper.step(*states[-1]))
        iterations.append(stepper.stats.iterations[1])
    return np.array(states), np.array(iterations)


@pytest.mark.parametrize("backend", ["osqp", "native"])
def test_a_warm_start_takes_fewer_iterations_to_the_same_place(backend: str) -> None:
    cold, warm = rest(4, backend=backend), rest(4, backend=backend, warm_start=True)
    np.testing.assert_allclose(warm[0], cold[0], rtol=0, atol=1e-9)
    assert warm[1][0] == cold[1][0]
    assert (warm[1][1:] < cold[1][1:]).all()


def test_without_a_warm_start_a_step_is_a_function_of_the_state() -> None:
    scene = deli.scenes.disc_pile(rows=5, columns=20)
    used = deli.GVI().stepper(scene, 0.01, solvers="osqp")
    state = scene.position, scene.momentum
    for _ in range(3):
        fresh = deli.GVI().stepper(scene, 0.01, solvers="osqp").step(*state)
        state = used.step(*state)
        for mine, theirs in zip(state, fresh, strict=True):
            assert mine.tobytes() == theirs.tobytes()


def test_what_is_too_large_for_a_dense_matrix_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "MOST_ENTRIES", 100)
    given, equalities = projection(0)
    with pytest.raises(deli.StepError, match=r"too many for 'daqp' .* for sparse matrices: clarabel.*osqp, piqp"):
        answer(solver_for(given, backend="daqp"), given, equalities)
    answer(solver_for(given, backend="osqp"), given, equalities)


@pytest.mark.parametrize("backend", ["daqp", "clarabel", "cvxpy:OSQP"])
def test_a_warm_start_is_refused_where_there_is_none(backend: str) -> None:
    choice = {"position": {"backend": backend, "warm_start": True}}
    with pytest.raises(deli.InputError, match=rf"{backend}' cannot begin at .*with it: native, auto, osqp"):
        deli.GVI().stepper(deli.scenes.disc_pile(rows=1, columns=2), 0.01, solvers=choice)


def test_a_warm_start_is_asked_for_by_true() -> None:
    with pytest.raises(deli.InputError, match="warm_start of 'osqp' is 1; allowed: true or false"):
        SolverChoice("osqp", warm_start=1)


@pytest.mark.parametrize(
    "scene",
    [deli.scenes.chain_on_cylinder(masses=90), deli.scenes.disc_pile(rows=5, columns=20)],
    ids=["chain", "pile"],
)
def test_the_native_solver_counts_and_measures_as_others_do(scene: deli.Scene) -> None:
    stats = []
    for choice in ("native", "piqp"):
        stepper = deli.GVI().stepper(scene, 0.002, solvers=choice)
        stepper.step(scene.position, scene.momentum)
        stats.append(stepper.stats)
    native, other = stats
    assert native.rows[1] > program.LARGEST_DENSE
    for name in ("solves", "skipped", "rows", "claimed", "verified", "fallbacks", "status"):
        np.testing.assert_array_equal(getattr(native, name), getattr(other, name), err_msg=name)
    for name in ("primal_residual", "dual_residual", "complementarity"):
        np.testing.assert_allclose(getattr(native, name), getattr(other, name), rtol=0, atol=1e-9, err_msg=name)
    assert (native.solve_time >= 0.0).all()
    assert (native.overhead_time >= 0.0).all()


def test_equations_alone_are_a_linear_solve_however_many() -> None:
    """A row of rods whose first end is struck across it."""
    bodies = program.LARGEST_DENSE + 20
    momentum = np.zeros((bodies, 2))
    momentum[0, 1] = 1.0
    scene = deli.Scene(
        mass=1.0,
        position=np.stack([np.arange(bodies), np.zeros(bodies)], axis=1),
        momentum=momentum,
        bilateral=deli.Rods([(k, k + 1) for k in range(bodies - 1)], 1.0),
        dimension=2,
    )
    stepper = deli.GVI().stepper(scene, 0.1, solvers="piqp")
    q, p = stepper.step(scene.position, scene.momentum)
    assert stepper.stats.solves.sum() == 0
    assert np.abs(scene.bilateral.value(q)).max() <= 1e-12
    np.testing.assert_allclose(p.reshape(-1, 2).sum(axis=0), [0.0, 1.0], atol=1e-12)
