"""The cvxpy models of all subproblems, by number and by whether the metric is a parameter."""

from deli.subproblems import position, projection, reflection

MODELS = (
    (reflection.model, reflection.numerical_model),
    (position.model, position.newton_model),
    (projection.model, projection.model),
)
"""Two models a subproblem, in the order of `deli.subproblems.choices.SUBPROBLEMS`."""
