"""The members of the chain "auto", chosen by a program's size, sparsity and curvature when it is compiled.

The table gives the median µs of a compiled re-solve on 2 shared cores, with the first member of each chain in brackets.
`deli bench backends` measures projections and predictive control anew, "auto" beside the others.

| program | n, rows | native | daqp | piqp | clarabel | osqp |
|---|---|---|---|---|---|---|
| projection, all entries | 30, 45 | (122) | 38 | 147 | 979 | 1256 |
| half of the variables without curvature, all entries | 20, 60 | – | (55) | 129 | 297 | 495 |
| predictive control | 34, 63 | – | (43) | 175 | 139 | 165 |
| projection, 5 % of the entries | 150, 225 | (1095) | 1574 | 20956 | 23157 | – |
| projection, 4 a row | 400, 600 | (21290) | 69497 | 127817 | 111835 | 109248 |
| predictive control | 128, 236 | – | 516 | 495 | (568) | 525 |
| predictive control | 220, 444 | – | 14919 | 760 | (795) | 826 |
| linear program, 4 a row, in a box | 100, 300 | – | 11044 | 1748 | (1685) | 2018574 |
| three bands of P, 3 a row | 150, 150 | 15787 | 1965 | 1672 | (1643) | – |
| projection, all entries | 200, 300 | 91234 | (20311) | 242849 | 497613 | 103066 |
| half without curvature, all entries | 200, 600 | – | (128638) | 221120 | 323787 | 299256 |
"""

import numpy as np

from solvers import registry
from solvers.program import QuadraticProgram

FEW = 0.05  # share of the entries of P and A up to which factors of sparse matrices pay
FILLED, SPARSE = ("daqp", "piqp"), ("clarabel", "piqp")  # of large programs


def choose(program: QuadraticProgram) -> tuple[str, ...]:
    """Return the members of the chain for a program, by its patterns and not by its numbers.

    A small program, which is stored dense, goes to the chain ``registry.CHAINS["auto"]``. Native is fast with
    curvature: it leads only where every variable has an entry on the diagonal of P. It keeps rows sparse if P has no
    other entries. The first member decides about the speed; the others answer where it fails.
    """
    P, A = program.quadratic, program.matrix
    columns = np.repeat(np.arange(program.variables), np.diff(P.indptr))
    curved = np.unique(columns[P.indices == columns]).size == program.variables
    if P.dense is not None:
        return tuple(name for name in registry.CHAINS["auto"] if curved or name != "native")
    if P.indices.size + A.indices.size > FEW * program.variables * (program.variables + program.rows):
        return FILLED
    return ("native", *SPARSE) if curved and columns.size == program.variables else SPARSE
