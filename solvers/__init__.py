"""Compile a parametrized cvxpy problem once, solve it many times with any backend."""

from solvers.backends.base import Answer, Backend
from solvers.code_folder import reserve as _reserve
from solvers.compiled import CompiledProblem, compile
from solvers.distribution import DISTRIBUTION
from solvers.errors import BackendError, NotInstalledError, ParameterError, SolverError, UnknownBackendError
from solvers.method import register_solve_method
from solvers.program import Matrix, QuadraticProgram
from solvers.registry import BackendInfo, able, available, backends, can, members, register, unregister
from solvers.solution import Solution, Status

_reserve()

__all__ = [
    "DISTRIBUTION",
    "Answer",
    "Backend",
    "BackendError",
    "BackendInfo",
    "CompiledProblem",
    "Matrix",
    "NotInstalledError",
    "ParameterError",
    "QuadraticProgram",
    "Solution",
    "SolverError",
    "Status",
    "UnknownBackendError",
    "able",
    "available",
    "backends",
    "can",
    "compile",
    "members",
    "register",
    "register_solve_method",
    "unregister",
]
