"""Backends at fault, each honest for as many solves as it is told to: they lie, raise, stall, or end their process.

Nothing but `solvers` is needed here, so that this file can be a package of its own.
"""

import ctypes
import os
import signal
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np

from solvers import Answer, Backend, Status, registry


class Panic(BaseException):
    """No Exception, as what comes of a panic in Rust."""


class Unreliable(Backend):
    """Answers by daqp to `honest` programs of a shape, and by `act` from then on."""

    sparse = False

    def __init__(self, program, tolerance, options):
        options = dict(options)
        self.left = options.pop("honest", 0)
        self.program, self.last = program, None
        self.inner = registry.factory("daqp")(program, tolerance, options)

    def update(self):
        self.inner.update()

    def solve(self):
        self.left -= 1
        answer = self.inner.solve()
        before, self.last = self.last, answer
        return answer if self.left >= 0 else self.act(answer, before)

    def act(self, answer, before):
        raise NotImplementedError


def lying(lie):
    """Make a backend of a function of the program, its honest answer and the answer to the program before."""

    class Liar(Unreliable):
        name = lie.__name__

        def act(self, answer, before):
            return lie(self.program, answer, before)

    return Liar


def saying(x, y):
    return Answer(x, y, Status.SOLVED, 1, "all is well")


random = np.random.default_rng(0)


def noise(program, answer, before):
    return saying(random.normal(size=program.variables), random.normal(size=program.rows))


def zeros(program, answer, before):
    return saying(np.zeros(program.variables), np.zeros(program.rows))


def wish(program, answer, before):
    """What would solve the program if it had no rows."""
    return saying(np.linalg.solve(program.quadratic.to_dense(), -program.linear), np.zeros(program.rows))


def wrong_multipliers(program, answer, before):
    return answer._replace(y=answer.y + 1.0)


def negative_multipliers(program, answer, before):
    return answer._replace(y=-np.abs(answer.y) - 0.5)


def wrong_sign(program, answer, before):
    return answer._replace(x=-answer.x, y=-answer.y)


def not_a_number(program, answer, before):
    return answer._replace(x=np.where(np.arange(answer.x.size) == 0, np.nan, answer.x))


def infinite(program, answer, before):
    return answer._replace(y=np.full(program.rows, np.inf))


def huge(program, answer, before):
    return saying(np.full(program.variables, 1e300), np.full(program.rows, 1e300))


def too_short(program, answer, before):
    return answer._replace(x=answer.x[:-1])


def too_long(program, answer, before):
    return answer._replace(x=np.append(answer.x, 0.0), y=np.append(answer.y, 0.0))


def a_column(program, answer, before):
    return answer._replace(x=answer.x[:, np.newaxis])


def integers(program, answer, before):
    return answer._replace(x=np.trunc(answer.x * 8).astype(int), y=np.trunc(answer.y * 8).astype(int))


def complex_numbers(program, answer, before):
    return answer._replace(x=answer.x + 1j)


def objects(program, answer, before):
    return answer._replace(y=np.array([None] * program.rows))


def words(program, answer, before):
    return answer._replace(x=["much"] * program.variables)


def stale(program, answer, before):
    """The answer to the program before."""
    return saying(np.zeros(program.variables), np.zeros(program.rows)) if before is None else before


def tampering(program, answer, before):
    """Makes a program that zero solves of what it was lent."""
    program.linear[:] = 0.0
    program.upper[:] = 0.0
    program.lower[: program.equalities] = 0.0
    return saying(np.zeros(program.variables), np.zeros(program.rows))


def single_precision(program, answer, before):
    return answer._replace(x=answer.x.astype(np.float32), y=answer.y.astype(np.float32))


def nothing(program, answer, before):
    return None


def unheard_of(program, answer, before):
    return answer._replace(claimed="solved beyond doubt")


def uncounted(program, answer, before):
    return answer._replace(iterations=None)


def hopeless(program, answer, before):
    return answer._replace(claimed=Status.FAILED)


def infeasible(program, answer, before):
    return answer._replace(claimed=Status.INFEASIBLE)


def unbounded(program, answer, before):
    return answer._replace(claimed=Status.UNBOUNDED)


def contradicted(program, answer, before):
    """With multipliers that would contradict the rows if they cancelled."""
    return Answer(np.full(program.variables, np.nan), np.ones(program.rows), Status.INFEASIBLE, 1, "no way")


def endless(program, answer, before):
    """With a direction in which forces push without end, if nothing stood in the way."""
    return Answer(-1e20 * program.linear, np.zeros(program.rows), Status.UNBOUNDED, 1, "no end")


LIES = {
    lie.__name__: lying(lie)
    for lie in (
        noise, zeros, wish, wrong_multipliers, negative_multipliers, wrong_sign, not_a_number, infinite, huge,
        too_short, too_long, a_column, integers, complex_numbers, objects, words, stale, tampering, single_precision,
        nothing, unheard_of, uncounted, hopeless, infeasible, unbounded, contradicted, endless,
    )
}  # fmt: skip


def acting(name, function):
    class Actor(Unreliable):
        def act(self, answer, before):
            function()
            return answer

    Actor.name = name
    return Actor


def error():
    raise RuntimeError("out of luck\nand of words")


def panic():
    raise Panic("index out of bounds")


def leave():
    raise SystemExit(0)


def stall():
    while True:
        time.sleep(0.01)


def stall_in_c():
    """Stall where no line of Python is run any more: in a call of the C library that signals do not end."""
    library = ctypes.CDLL(None)
    mutex = ctypes.create_string_buffer(256)
    for _ in range(2):  # the second waits for the first to be undone
        library.pthread_mutex_lock(mutex)


def exit_at_once():
    os._exit(3)


def crash():
    os.kill(os.getpid(), signal.SIGSEGV)


RAISING = {function.__name__: acting(function.__name__, function) for function in (error, panic, leave)}
ENDING = {
    function.__name__: acting(function.__name__, function) for function in (stall, stall_in_c, exit_at_once, crash)
}

offered = SimpleNamespace(**LIES, **RAISING, **ENDING)  # for entry points: lies:offered.NAME


@contextmanager
def registered():
    """Make all of them known for a while."""
    known = {**LIES, **RAISING, **ENDING}
    for name, factory in known.items():
        registry.register(name, factory)
    try:
        yield
    finally:
        for name in known:
            registry.unregister(name)
