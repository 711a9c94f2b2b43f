"""All mutants of a module in one: each place checks at run time whether it is changed."""

import ast
import copy
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult,
    ast.Pow: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Add, ast.MatMult: ast.Mult,
}  # fmt: skip
_OPPOSITE = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
_OTHER_CALL = {"min": "max", "max": "min", "any": "all", "all": "any"}
# Messages, types, and functions within functions.
_LEFT = (ast.JoinedStr, ast.Raise, ast.Assert, ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom, ast.pattern)


class Mutant(NamedTuple):
    """A place in a file, and the code that replaces it."""

    file: Path
    line: int
    before: str
    after: str


def mutate(file: Path, functions: list[ast.FunctionDef], chosen: str, first: int) -> list[Mutant]:
    """Put the mutants of some functions into them, numbered from `first`; return them.

    Which one is asked for, the function `chosen` tells.
    """
    writer = _Writer(file, chosen, first)
    for function in functions:
        function.body = [each for statement in function.body for each in writer.statements(statement)]
    return writer.mutants


class _Writer(ast.NodeTransformer):
    def __init__(self, file: Path, chosen: str, first: int) -> None:
        self.file, self.chosen, self.first = file, chosen, first
        self.mutants: list[Mutant] = []

    def statements(self, statement: ast.stmt) -> list[ast.stmt]:
        changed = self.visit(statement)
        return changed if isinstance(changed, list) else [changed]

    def visit(self, node: ast.AST) -> ast.AST | list[ast.stmt]:
        if isinstance(node, _LEFT) or _is_shape(node):
            return node
        plain = copy.deepcopy(node)
        if isinstance(node, ast.AnnAssign):
            if node.value is not None:
                node.value = self.visit(node.value)
            return node
        changed = self.generic_visit(node)
        if isinstance(node, ast.expr):
            for other in _others(plain):
                chosen = self._chosen(plain, other)
                changed = ast.copy_location(ast.IfExp(chosen, other, changed), plain)
            return changed
        if isinstance(node, ast.If | ast.While) and _opaque(node.test):
            other = ast.UnaryOp(ast.Not(), plain.test)
            node.test = ast.IfExp(self._chosen(plain.test, other), other, node.test)
        if isinstance(node, ast.AugAssign) and type(node.op) in _ARITHMETIC:
            other = ast.AugAssign(plain.target, _ARITHMETIC[type(node.op)](), plain.value)
            return ast.copy_location(ast.If(self._chosen(plain, other), [other], [changed]), plain)
        if _can_go(plain):
            chosen = self._chosen(plain, ast.Pass())
            return [ast.copy_location(ast.If(ast.UnaryOp(ast.Not(), chosen), [changed], []), plain)]
        return changed

    def _chosen(self, node: ast.AST, other: ast.AST) -> ast.expr:
        text = [ast.unparse(ast.fix_missing_locations(ast.copy_location(each, node))) for each in (node, other)]
        self.mutants.append(Mutant(self.file, node.lineno, *text))
        number = ast.Constant(self.first + len(self.mutants) - 1)
        return ast.Call(ast.Name(self.chosen, ast.Load()), [number], [])


def _is_shape(node: ast.AST) -> bool:
    return isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute) and node.value.attr == "shape"


def _opaque(test: ast.expr) -> bool:
    """Return whether a condition has no mutant that is its opposite."""
    return isinstance(test, ast.Name | ast.Attribute | ast.Subscript | ast.Call)


def _can_go(statement: ast.AST) -> bool:
    """Return whether names stay defined if a statement is left out."""
    if isinstance(statement, ast.Assign):
        return not any(isinstance(part, ast.Name | ast.Tuple) for part in statement.targets)
    if isinstance(statement, ast.Expr):
        return isinstance(statement.value, ast.Call)
    return isinstance(statement, ast.Continue | ast.Break)


def _others(node: ast.expr) -> Iterator[ast.expr]:
    """Yield the expressions that may replace an expression."""
    match node:
        case ast.BinOp(left, operator, right) if type(operator) in _ARITHMETIC:
            yield ast.BinOp(left, _ARITHMETIC[type(operator)](), right)
        case ast.Compare(left, [operator], others):
            for table in (_OPPOSITE, _BOUNDARY):
                if type(operator) in table:
                    yield ast.Compare(left, [table[type(operator)]()], others)
        case ast.BoolOp(operator, values):
            yield ast.BoolOp(ast.And() if isinstance(operator, ast.Or) else ast.Or(), values)
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield operand
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(float(value)):
            yield ast.Constant(2.0 * value if value else 1.0)
        case ast.Call(ast.Name(name), arguments, []) if name in _OTHER_CALL:
            yield ast.Call(ast.Name(_OTHER_CALL[name], ast.Load()), arguments, [])
        case ast.Call(ast.Name("abs"), [argument], []):
            yield argument
