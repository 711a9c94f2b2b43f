"""Where the codes of kernels go: which functions return one, and whether their callers look at it on every path.

A code is bound to a name, which is *live* until it is known to be DONE, is returned, or is answered for by name. The
code of a function whose root is sought waits in ``meeting[2]``, which is live in the same way.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field

from deli.kernels import codes

FAILURES = {name for name, value in vars(codes).items() if isinstance(value, int) and value >= codes.RAISED}
CODES = FAILURES | {"DONE", "REFRESH"}
WAITING = "meeting[2]"
HANDED_ON = {"find_root"}  # they call functions that leave their codes waiting
ANSWER = "the answer of a function in Python"


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    """Yield all functions of a module."""
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def label(node: ast.AST) -> str:
    """Return the name under which a code is known: a variable's, a constant's, or `WAITING`."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return node.attr
    if isinstance(node, ast.Subscript) and ast.unparse(node).endswith(f".{WAITING}"):
        return WAITING
    return ""


def first(node: ast.AST | None) -> ast.AST | None:
    """Return the first of several values, where the code is."""
    return node.elts[0] if isinstance(node, ast.Tuple) and node.elts else node


def parts(node: ast.AST | None) -> list[ast.AST]:
    """Return both values of a conditional expression, or the one value of another."""
    node = first(node)
    if isinstance(node, ast.IfExp):
        return [*parts(node.body), *parts(node.orelse)]
    return [] if node is None else [node]


def returns_code(function: ast.FunctionDef, coded: set[str]) -> bool:
    """Return whether a function returns a code, given the functions that are known to."""
    bound: set[str] = set()
    for _ in range(2):
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and any(_is_code(part, coded, bound) for part in parts(node.value)):
                bound.add(label(first(node.targets[0])))
    returned = [node.value for node in ast.walk(function) if isinstance(node, ast.Return)]
    return any(_is_code(part, coded, bound) for value in returned for part in parts(value))


def _is_code(node: ast.AST, coded: set[str], bound: set[str]) -> bool:
    if isinstance(node, ast.Call):
        return called(node) in coded
    return label(node) in CODES | bound


def called(node: ast.Call) -> str:
    """Return the name of the function called; ``bound.call`` is one."""
    if isinstance(node.func, ast.Attribute):
        return "bound.call" if ast.unparse(node.func).endswith("bound.call") else ""
    return label(node.func)


def leaves_code(function: ast.FunctionDef) -> bool:
    """Return whether a function leaves its code in ``meeting[2]``."""
    assigned = (node for node in ast.walk(function) if isinstance(node, ast.Assign))
    return any(label(node.targets[0]) == WAITING and label(node.value) != "DONE" for node in assigned)


@dataclass
class Flow:
    """The paths through one function, and what they drop.

    Attributes
    ----------
    coded, leaving : set of str
        Functions that return a code, and that leave one waiting.
    dropped : list of str
        Lines at which a code is lost.
    """

    coded: set[str]
    leaving: set[str]
    dropped: list[str] = field(default_factory=list)

    def follow(self, function: ast.FunctionDef) -> list[str]:
        """Return where the function drops a code."""
        end = self._block(function.body, frozenset(), [], [])
        if end and not (leaves_code(function) and end == {WAITING}):
            self._drop(function.body[-1], f"{', '.join(sorted(end))} at the end")
        return self.dropped

    def _drop(self, node: ast.AST, why: str) -> None:
        found = f"line {node.lineno}: {why}"
        if found not in self.dropped:
            self.dropped.append(found)

    def _block(self, body, live, breaks, continues):
        """Return what is live after the statements, or None where none of their paths ends."""
        for statement in body:
            live = self._statement(statement, live, breaks, continues)
            if live is None:
                return None
        return live

    def _statement(self, node, live, breaks, continues):
        if isinstance(node, ast.If):
            taken, passed = self._test(node.test, live)
            return _join(
                self._block(node.body, taken, breaks, continues), self._block(node.orelse, passed, breaks, continues)
            )
        if isinstance(node, ast.While | ast.For):
            return self._loop(node, live)
        if isinstance(node, ast.Try):
            ends = [self._block(node.body, live, breaks, continues)]
            ends += [self._block(handler.body, frozenset(), breaks, continues) for handler in node.handlers]
            return _join(*ends)
        if isinstance(node, ast.With):
            return self._block(node.body, live, breaks, continues)
        if isinstance(node, ast.Break | ast.Continue):
            (breaks if isinstance(node, ast.Break) else continues).append(live)
            return None
        if isinstance(node, ast.Raise):
            return None
        if isinstance(node, ast.Return):
            self._return(node, live)
            return None
        if isinstance(node, ast.Assign):
            return self._assign(node, live)
        return live | self._inside(node)

    def _loop(self, node, live):
        entered = live
        for _ in range(3):
            breaks, continues = [], []
            endless = isinstance(node, ast.While) and label(node.test) == "" and ast.unparse(node.test) == "True"
            taken, passed = self._test(node.test, entered) if isinstance(node, ast.While) else (entered, entered)
            end = self._block(node.body, taken, breaks, continues)
            entered = _join(entered, end, *continues)
        return _join(*breaks, None if endless else passed)

    def _assign(self, node, live):
        target, values = label(first(node.targets[0])), parts(node.value)
        direct = [part for part in values if isinstance(part, ast.Call) and called(part) in self.coded]
        live = live | self._inside(node.value, direct)
        moved = {label(part) for part in values} & live
        if target in live - moved and target != WAITING:
            self._drop(node, f"{target} is overwritten")
        live = live - moved - {target}
        return live | {target} if (direct or moved) and target != WAITING else live

    def _return(self, node, live):
        values = parts(node.value)
        direct = [part for part in values if isinstance(part, ast.Call) and called(part) in self.coded]
        live = live | self._inside(node, direct)
        names = {label(part) for part in values}
        if live - names and not names & FAILURES and not names & live:
            self._drop(node, f"{', '.join(sorted(live - names))} is not returned")

    def _inside(self, node, allowed=()):
        """Look at calls within a node; what they leave is live."""
        live, answered = set(), set()
        for inner in ast.walk(node):
            if isinstance(inner, ast.Compare) and label(inner.comparators[0]) == "ANSWERED":
                answered.add(inner.left)
        for inner in ast.walk(node):
            if isinstance(inner, ast.Call):
                if called(inner) in self.leaving:
                    live.add(WAITING)
                elif called(inner) in self.coded and inner not in allowed and inner not in answered:
                    self._drop(inner, f"the code of {called(inner)} is not bound to a name")
        return live

    def _test(self, node, live):
        """Return what is live where the test holds, and where it does not."""
        if isinstance(node, ast.BoolOp):
            both = isinstance(node.op, ast.And)
            left = None
            for part in node.values:
                yes, no = self._test(part, live)
                live, left = (yes, _join(left, no)) if both else (no, _join(left, yes))
            return (live, left) if both else (left, live)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yes, no = self._test(node.operand, live)
            return no, yes
        live = live | self._inside(node)
        if isinstance(node, ast.Compare):
            name, operator, other = label(node.left), node.ops[0], label(node.comparators[0])
            if isinstance(operator, ast.In) or other in {"DONE", "REFRESH"}:
                known = live - {name}
                return (live, known) if isinstance(operator, ast.NotEq) else (known, live)
            if other == "ANSWERED":
                return (live | {ANSWER}, live) if isinstance(operator, ast.NotEq) else (live, live | {ANSWER})
        return live, live


def _join(*states):
    known = [state for state in states if state is not None]
    return frozenset().union(*known) if known else None
