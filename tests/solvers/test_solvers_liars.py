"""Whatever a backend hands back, or writes into what it is lent: what is called solved solves what was posed."""

import re

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from known_projections import SOLVABLE

import solvers
from solvers import Answer, Backend, Status, registry

PROBLEM = next(problem for problem in SOLVABLE if problem.name == "mixed")
HONEST = solvers.compile(PROBLEM.model(), "daqp").solve(**PROBLEM.values())
EXAMPLES = settings(max_examples=150, deadline=None, derandomize=True)


class Puppet(Backend):
    """Does what `act` says, with the program in its hands."""

    name = "puppet"
    act = staticmethod(lambda program: None)

    def __init__(self, program, tolerance, options):
        self.program = program

    def update(self):
        pass

    def solve(self):
        return Puppet.act(self.program)


@pytest.fixture(scope="module", autouse=True)
def _registered():
    registry.register("puppet", Puppet)
    yield
    registry.unregister("puppet")


@pytest.fixture(scope="module")
def puppet():
    """A way to solve `PROBLEM` with whatever a function of its program says, polished or not."""
    compiled = {polish: solvers.compile(PROBLEM.model(), "puppet", polish=polish) for polish in (False, True)}

    def solve(act, polish=False):
        Puppet.act = staticmethod(act)
        return compiled[polish].solve(**PROBLEM.values())

    return solve


def assert_right(solution):
    np.testing.assert_allclose(solution.primal["velocity"], HONEST.primal["velocity"], rtol=0, atol=1e-4)


NUMBERS = st.one_of(
    arrays.arrays(np.float64, 2, elements=st.floats(allow_nan=True, allow_infinity=True)),
    arrays.arrays(np.float64, 2, elements=st.floats(-2.0, 2.0)),
)
ANYTHING = st.one_of(
    st.none(), st.text(max_size=3), st.integers(), st.floats(), st.lists(st.floats(), max_size=4), NUMBERS,
    arrays.arrays(
        st.sampled_from([np.dtype(name) for name in ("f4", "i8", "c16", "?", "U2", "O", ">f8")]),
        arrays.array_shapes(min_dims=0, max_dims=3, max_side=3),
    ),
)  # fmt: skip


@given(
    x=ANYTHING,
    y=ANYTHING,
    claimed=st.one_of(st.sampled_from(list(Status)), st.none(), st.text(max_size=3), st.just("solved")),
    iterations=st.one_of(st.integers(), st.none(), st.floats(), st.just(np.int32(3))),
    message=st.one_of(st.text(max_size=3), st.none()),
    polish=st.booleans(),
)
@EXAMPLES
def test_anything_can_be_handed_back(puppet, x, y, claimed, iterations, message, polish):
    with np.errstate(all="ignore"):
        solution = puppet(lambda program: Answer(x, y, claimed, iterations, message), polish)
    assert solution.status in Status
    assert solution.status not in (Status.INFEASIBLE, Status.UNBOUNDED)
    if solution.ok:
        assert_right(solution)
        assert max(solution.primal_residual, solution.dual_residual, solution.complementarity) <= 1e-9


@pytest.mark.parametrize("given_back", [None, 7, "solved", (1, 2, 3), [np.zeros(2), np.zeros(2)]])
def test_what_is_no_answer_is_a_failure_that_says_so(puppet, given_back):
    solution = puppet(lambda program: given_back)
    assert (solution.status, solution.claimed) == (Status.FAILED, Status.FAILED)
    assert solution.message.endswith("was returned where a solvers.Answer is due")


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (np.zeros(3), r"x is an array of shape \(3,\) and type float64 where 2 real numbers are due"),
        (np.zeros((2, 1)), r"x is an array of shape \(2, 1\) "),
        (np.zeros(2, dtype=complex), "type complex128"),
        (None, "x is None where 2 real"),
        ([[0.0], [0.0, 1.0]], "x is a list where 2 real"),
    ],
)
def test_arrays_that_do_not_fit_are_named(puppet, x, said):
    solution = puppet(lambda program: Answer(x, np.zeros(2), Status.SOLVED, 1, "optimal"))
    assert (solution.status, solution.claimed) == (Status.FAILED, Status.SOLVED)
    assert np.isnan(solution.primal["velocity"]).all()
    assert re.search(said, solution.message)


@pytest.mark.parametrize("numbers", ["int64", "float32", ">f8"])
def test_numbers_of_another_type_are_numbers(puppet, numbers):
    x, y = np.array([0.75, 0.25]), np.array([-0.25, 0.5])
    scale = 4 if numbers == "int64" else 1
    solution = puppet(lambda program: Answer((scale * x).astype(numbers), y.astype(numbers), Status.SOLVED, 1, ""))
    assert solution.ok == (scale == 1)
    assert solution.primal["velocity"].dtype == np.dtype(float)


def test_an_answer_is_no_longer_the_backends(puppet):
    kept = np.array([0.75, 0.25]), np.array([-0.25, 0.5])
    solution = puppet(lambda program: Answer(*kept, Status.SOLVED, 1, ""))
    kept[0][:] = 9.0
    kept[1][:] = 9.0
    assert_right(solution)
    np.testing.assert_allclose(solution.dual[0], HONEST.dual[0], atol=1e-12)


def test_parts_of_the_program_can_be_the_answer(puppet):
    first = puppet(lambda program: Answer(program.linear, program.upper, Status.SOLVED, 1, ""))
    assert first.status is Status.INACCURATE
    kept = first.primal["velocity"].copy()
    puppet(lambda program: Answer(np.array([0.75, 0.25]), np.array([-0.25, 0.5]), Status.SOLVED, 1, ""))
    np.testing.assert_array_equal(first.primal["velocity"], kept)


@pytest.mark.parametrize("storage", ["dense", "sparse"])
@given(data=st.data())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_what_is_written_into_the_program_changes_no_verdict(storage, data):
    """Not of this answer, nor of any later one, whatever it is that is written, and where."""
    with pytest.MonkeyPatch.context() as patch:
        if storage == "sparse":
            patch.setattr("solvers.affine.DENSE_LIMIT", 0)
        compiled = solvers.compile(PROBLEM.model(), "puppet")
    values = st.sampled_from([0.0, 1.0, -3.0, np.nan, np.inf, 1e300])

    def tamper(program):
        matrices = (program.quadratic, program.matrix)
        numbers = [program.linear, program.upper, program.lower, *(matrix.values for matrix in matrices)]
        patterns = [array for matrix in matrices for array in (matrix.indptr, matrix.indices)]
        for array in data.draw(st.lists(st.sampled_from(range(5)), min_size=1)):
            numbers[array][:] = data.draw(values)
        if storage == "sparse":
            patterns[data.draw(st.sampled_from(range(4)))][:] = 1
        return Answer(np.zeros(2), np.zeros(2), Status.SOLVED, 1, "")

    Puppet.act = staticmethod(tamper)
    assert compiled.solve(**PROBLEM.values()).status is Status.INACCURATE
    right = Answer(np.array([0.75, 0.25]), np.array([-0.25, 0.5]), Status.SOLVED, 1, "")
    Puppet.act = staticmethod(lambda program: right)
    assert compiled.solve(**PROBLEM.values()).ok
    assert (compiled.program.lower[compiled.program.equalities :] == -np.inf).all()


class TestRaising:
    @pytest.mark.parametrize("error", [RuntimeError("out of luck\nand words"), SystemExit(0), GeneratorExit("enough")])
    def test_whoever_raises_is_named(self, puppet, error):
        def act(program):
            program.linear[:] = 0.0
            raise error

        first = str(error).partition("\n")[0]
        with pytest.raises(
            solvers.BackendError, match=f"backend 'puppet' raised {type(error).__name__}: {first}$"
        ) as info:
            puppet(act)
        assert info.value.__cause__ is error
        right = Answer(np.array([0.75, 0.25]), np.array([-0.25, 0.5]), Status.SOLVED, 1, "")
        assert puppet(lambda program: right).ok

    @pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
    def test_what_is_not_the_backends_fault_passes(self, puppet, error):
        def act(program):
            raise error

        with pytest.raises(error):
            puppet(act)

    def test_a_chain_goes_on_behind_it(self, puppet, monkeypatch):
        def act(program):
            program.upper[:] = -1.0
            raise RuntimeError

        monkeypatch.setitem(registry.CHAINS, "auto", ("puppet", "daqp"))
        Puppet.act = staticmethod(act)
        compiled = solvers.compile(PROBLEM.model())
        solution = compiled.solve(**PROBLEM.values())
        assert (solution.ok, solution.backend, solution.fallbacks) == (True, "daqp", 1)
        assert_right(solution)
        monkeypatch.setitem(registry.CHAINS, "auto", ("daqp", "puppet"))
        assert solvers.compile(PROBLEM.model()).solve(**PROBLEM.values()).fallbacks == 0

    def test_a_backend_that_cannot_be_set_up_is_named(self, registered):
        class Broken(Puppet):
            def __init__(self, program, tolerance, options):
                raise OSError("no licence")

        registered("broken", Broken)
        with pytest.raises(solvers.BackendError, match="backend 'broken' raised OSError: no licence"):
            solvers.compile(PROBLEM.model(), "broken")


@st.composite
def claims(draw):
    """Rows that repeat and oppose each other, and a point with multipliers of any size."""
    entries = st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0])
    rows = draw(arrays.arrays(float, (2, 2), elements=entries))
    matrix = np.concatenate((rows, -rows[:1], draw(st.sampled_from([rows[1:], -rows[1:]]))))
    sizes = st.one_of(st.floats(-2.0, 2.0), st.sampled_from([0.0, 1e6, -1e6, 1e12, 1e-9]))
    x = draw(arrays.arrays(float, 2, elements=st.sampled_from([0.0, 1.0, -1.0, 1e-6])))
    return matrix, x, draw(arrays.arrays(float, 4, elements=sizes))


@pytest.fixture(scope="module")
def verdict():
    v = cp.Variable(2, name="velocity")
    linear, matrix, upper = cp.Parameter(2, name="q"), cp.Parameter((4, 2), name="A"), cp.Parameter(4, name="u")
    problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(v) + linear @ v), [matrix @ v <= upper])
    claiming, honest = solvers.compile(problem, "puppet"), solvers.compile(problem, "auto", polish=True)

    def solve(x, y, **numbers):
        Puppet.act = staticmethod(lambda program: Answer(x, y, Status.SOLVED, 1, ""))
        return claiming.solve(**numbers), honest.solve(**numbers)

    return solve


class TestVerdict:
    """What is called solved is near the solution, even where somebody who knows the residuals chose it."""

    @given(claims(), st.sampled_from([0.0, 1e-7, 1.0]))
    @settings(max_examples=500, deadline=None, derandomize=True)
    def test_a_point_chosen_to_balance_is_solved_only_if_it_is(self, verdict, claim, slack):
        """The linear term is chosen such that the forces balance, and rows such that they touch."""
        matrix, x, y = claim
        linear, upper = -(x + matrix.T @ y), matrix @ x + slack
        found, right = verdict(x, y, q=linear, A=matrix, u=upper)
        if found.ok and right.ok:
            size = 1.0 + np.abs(linear).max() + np.abs(upper).max()
            error = np.abs(found.primal["velocity"] - right.primal["velocity"]).max()
            assert error <= 10.0 * np.sqrt(1e-9) * size

    def test_large_multipliers_that_cancel_hide_no_pull(self, verdict):
        """Between two walls that leave no room, a third one holds the point although it should let go."""
        matrix = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
        y = np.array([1e12, 1e12, -1.0, 0.0])
        found, right = verdict(np.zeros(2), y, q=np.array([0.0, 1.0]), A=matrix, u=np.zeros(4))
        np.testing.assert_allclose(right.primal["velocity"], [0.0, -1.0], atol=1e-12)
        assert found.status is Status.INACCURATE
