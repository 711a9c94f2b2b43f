"""The three subproblems of a step (theory: reflection 6.6-6.9, position update 7.3-7.4, momentum projection 7.5-7.6).

Each file opens with the cvxpy model of its subproblem; what follows is how a step uses it.
"""
