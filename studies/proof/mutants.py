"""Mutation testing of deli's arithmetic: `python studies/proof/mutants.py --help`."""

import argparse
import ast
import ctypes
import hashlib
import json
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import compiled_code
import memory
import mutations
import pytest

ROOT = compiled_code.ROOT
MUTATED = ("deli/kernels/*.py", "solvers/native*.py", "solvers/kernels.py", "solvers/residuals.py")
MUTATED += ("solvers/backends/native.py", "deli/integrators/*.py", "deli/subproblems/*.py")
# Files that compile kernels, and hold none.
LEFT = {"build.py", "compiled.py", "record.py", "__init__.py"}
MEMORY = 8 << 30
PYTHON, COMPILED = "_mutant", "_compiled_mutant"


class Mutants:
    """The mutants of all files, in the modules that are imported from now on."""

    def __init__(self) -> None:
        self.files = sorted(f for pattern in MUTATED for f in ROOT.glob(pattern) if f.name not in LEFT)
        self.trees: dict[Path, ast.Module] = {}
        self.mutants: list[mutations.Mutant] = []
        for file in self.files:
            tree = self.trees[file] = ast.parse(file.read_text())
            compiled = compiled_code.compiled_functions(tree)
            self.mutants += mutations.mutate(file, compiled, COMPILED, len(self.mutants))
            others = [each for each in _functions(tree) if each not in compiled]
            self.mutants += mutations.mutate(file, others, PYTHON, len(self.mutants))
        self._active = ctypes.c_int64(-1)
        self._reached = ctypes.create_string_buffer(len(self.mutants))

    def choose(self, number: int) -> None:
        self._active.value = number

    def reached(self) -> list[int]:
        """Return the places reached since the last call."""
        places = [number for number, mark in enumerate(self._reached.raw[: len(self.mutants)]) if mark]
        ctypes.memset(self._reached, 0, len(self.mutants))
        return places

    def install(self) -> None:
        code = "".join(ast.unparse(ast.fix_missing_locations(tree)) for tree in self.trees.values())
        self.folder = ROOT / f".mutants-{hashlib.sha256(code.encode()).hexdigest()[:16]}"
        self.folder.mkdir(exist_ok=True)
        os.environ["NUMBA_CACHE_DIR"] = str(self.folder)
        sys.meta_path.insert(0, compiled_code.Importer(self._put, self._names, self.files))

    def _put(self, file: Path, tree: ast.Module) -> None:
        tree.body[:] = self.trees[file].body

    def _names(self) -> dict[str, Any]:
        if not hasattr(self, "_functions"):
            active, reached = self._active, self._reached
            store = memory.store("deli_reached", ctypes.addressof(reached))
            equals = memory.equals("deli_active", ctypes.addressof(active))

            def chosen(number: int) -> bool:
                reached[number] = 1
                return active.value == number

            self._functions = {PYTHON: chosen, COMPILED: _both(store, equals)}
        return self._functions


def _both(store: Any, equals: Any) -> Any:
    from solvers.absorbed import absorbed

    @absorbed
    def chosen(number: int) -> bool:
        store(number)
        return equals(number)

    return chosen


def _functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    for node in tree.body:
        for each in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(each, ast.FunctionDef):
                yield each


class Runner:
    """A pytest plugin that collects once, and then runs tests in a fork for each mutant."""

    def __init__(self, mutants: Mutants, numbers: list[int], budget: float, output: Path) -> None:
        self.mutants, self.numbers, self.budget, self.output = mutants, numbers, budget, output
        self.failed: list[str] = []

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed.append(report.nodeid)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: Any) -> bool:
        load()
        tests = self.measure(session)
        with self.output.open("a") as stream:
            for number in self.numbers:
                record = self.judge(session, tests, number)
                print(json.dumps(record), file=stream, flush=True)
        return True

    def measure(self, session: Any) -> list[tuple[float, set[int], int]]:
        """Return the cost of each test and the places that it reaches, module by module, without tests that fail.

        A module whose file is what it was is not measured again.
        """
        modules: dict[Path, dict[str, int]] = {}
        for place, item in enumerate(session.items):
            modules.setdefault(item.path, {})[item.nodeid] = place
        tests = []
        for module, places in modules.items():
            digest = hashlib.sha256(module.read_bytes() + repr(sorted(places)).encode()).hexdigest()
            answer = self.mutants.folder / f"{module.stem}-{digest[:16]}.json"
            if not answer.exists():
                items = [session.items[place] for place in places.values()]
                code, seconds = fork(lambda items=items, answer=answer: self._measure(items, answer), 3600)
                if code != 0:
                    raise RuntimeError(f"{module} ended with {code} without a mutant")
                print(f"{module}: {len(places)} tests, {seconds:.0f} s", file=sys.stderr, flush=True)
            for name, cost, reached in json.loads(answer.read_text()):
                tests.append((cost, set(reached), places[name]))
        return sorted(tests, key=lambda test: test[0] * len(test[1]))  # first quick tests that reach few other places

    def _measure(self, items: list[Any], answer: Path) -> int:
        found = []
        for item in items:
            start = time.process_time()
            self.mutants.reached()
            self.failed.clear()
            _run(item)
            if not self.failed:
                found.append((item.nodeid, time.process_time() - start, self.mutants.reached()))
        answer.write_text(json.dumps(found))
        return 0

    def judge(self, session: Any, tests: list[tuple[float, set[int], int]], number: int) -> dict[str, Any]:
        chosen, cost = [], 0.0
        for seconds, reached, place in tests:
            if number in reached and cost + seconds <= self.budget:
                chosen.append(place)
                cost += seconds
        mutant = self.mutants.mutants[number]
        record = mutant._asdict() | {"file": str(mutant.file.relative_to(ROOT)), "number": number, "tests": len(chosen)}
        if not chosen:
            return record | {"outcome": "not reached"}

        def test() -> int:
            self.mutants.choose(number)
            for place in chosen:
                _run(session.items[place])
                if self.failed:
                    return 1
            return 0

        code, seconds = fork(test, round(10.0 + 3.0 * cost))
        outcome = {0: "survived", 1: "killed", -signal.SIGXCPU: "endless", -signal.SIGALRM: "endless"}.get(
            code, "crashed"
        )
        return record | {"outcome": outcome, "seconds": round(seconds, 1)}


def _run(item: Any) -> None:
    item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)


def load() -> None:
    """Import and load all code that every fork needs."""
    import deli
    from deli.kernels.compiled import UNITS

    for unit in UNITS.values():  # in order, so that each unit finds its callees
        unit.compile()
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.1, steps=1)


def fork(action: Callable[[], int], most: int) -> tuple[int, float]:
    """Run an action in a process of its own with a limit of CPU seconds; return its exit code and its time."""
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))
        signal.alarm(60 * most)  # for a process that waits
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        code = 70
        try:
            code = action()
        finally:
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    return os.waitstatus_to_exitcode(status), time.monotonic() - start


def main() -> None:
    """Run mutants against tests."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("tests", nargs="*", help="arguments of pytest's collection")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="JSON lines, one a mutant; mutants in it are not run again"
    )
    parser.add_argument("--files", default="", help="only mutants of files whose path contains this")
    parser.add_argument("--count", type=int, help="number of mutants, drawn at random with seed 0")
    parser.add_argument("--again", type=Path, help="only mutants that survived in this file, or were not reached")
    parser.add_argument("--budget", type=float, default=1.5, help="CPU seconds of tests for a mutant")
    options = parser.parse_args()
    mutants = Mutants()
    mutants.install()
    numbers = [k for k, mutant in enumerate(mutants.mutants) if options.files in str(mutant.file)]
    if options.again:
        records = map(json.loads, options.again.read_text().splitlines())
        numbers = [each["number"] for each in records if each["outcome"] in ("survived", "not reached")]
    random.Random(0).shuffle(numbers)
    done = map(json.loads, options.output.read_text().splitlines() if options.output.exists() else ())
    judged = {each["number"] for each in done}
    numbers = [number for number in numbers[: options.count] if number not in judged]
    print(f"{len(numbers)} of {len(mutants.mutants)} mutants", file=sys.stderr)
    runner = Runner(mutants, numbers, options.budget, options.output)
    sys.exit(pytest.main(["-q", "-n", "0", "-p", "no:faulthandler", *options.tests], [runner]))


if __name__ == "__main__":
    main()
