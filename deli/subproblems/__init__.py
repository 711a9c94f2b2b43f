"""The three subproblems of a step (theory: reflection 6.6-6.9, position update 7.3-7.4, momentum projection 7.5-7.6).

`reflection`, `position` and `projection` hold their cvxpy models; the other files hold the use of the models by a step.
"""
