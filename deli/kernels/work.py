"""The working arrays of a step, the islands of bodies in contact, and the statistics."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deli.kernels.arrays import Flags, Matrix, Numbers, Vector


class Work(NamedTuple):
    """Arrays of one step, by degree of freedom, by unilateral row, by bilateral row.

    `span` holds h, the size of the step at hand. It is an array, because plain numbers in a record never change, and
    methods also take parts of a step. `level` is the lower bound of a gap in a position update, 0 unless a contact
    lands. `here` is ∇V(q), `latent` the momentum along the gradients of landed contacts, `spot` the point at which the
    constraints of a position update are taken, and `base` and `held_base` are the values of affine rows at u = 0. The
    arrays of collision integrators, from `start` to `balance`, are described in `deli.kernels.fractions`. `memory`
    holds the arrays that a method carries from step to step besides q and p, one row for each of its names, and
    `remembered` holds them after the step. `struck` counts the contacts that the step at hand has reflected, and
    `marked` the passes of a reflection off each row.
    """

    span: Vector
    q: Vector
    p: Vector
    memory: Matrix
    moved: Vector
    carried: Vector
    remembered: Matrix
    momentum: Vector
    velocity: Vector
    force: Vector
    stress: Vector
    here: Vector
    latent: Vector
    spot: Vector
    before: Vector
    best: Vector
    best_force: Vector
    predicted: Vector
    predicted_velocity: Vector
    predicted_force: Vector
    free_momentum: Vector
    gaps: Vector
    gaps_moved: Vector
    level: Vector
    base: Vector
    normals: Matrix
    normals_moved: Matrix
    gradients: Matrix
    gradients_moved: Matrix
    approach: Vector
    still: Vector
    touching: Flags
    active: Flags
    landing: Flags
    resting: Flags
    marked: Numbers
    chosen: Numbers
    smooth: Numbers
    pressing: Numbers
    pressed: Vector
    scaled: Vector
    best_pressed: Vector
    best_scaled: Vector
    mismatch: Vector
    held_base: Vector
    held_normals: Matrix
    held_normals_moved: Matrix
    held_gradients: Matrix
    held_gradients_moved: Matrix
    start: Vector
    start_momentum: Vector
    event: Vector
    event_momentum: Vector
    incoming: Vector
    impulse: Vector
    meeting: Numbers
    struck: Numbers
    balance: Vector
    report: Vector
    ticks: Numbers


class Islands(NamedTuple):
    """Bodies and rows by connected component; see `deli.kernels.islands`.

    `touched` lists the bodies whose labels are not -1, and ends with their number.
    """

    parent: Numbers
    label: Numbers
    place: Numbers
    body_start: Numbers
    bodies: Numbers
    row_start: Numbers
    rows: Numbers
    held_start: Numbers
    held: Numbers
    touched: Numbers
    joint_start: Numbers
    joints: Numbers


class Tally(NamedTuple):
    """The statistics behind `deli.subproblems.stats.StepStats`.

    Attributes
    ----------
    counts : (7, 3) int64 array
        Solves, skipped, iterations, rows, fallbacks, claimed and verified solves, by subproblem.
    times : (2, 3) array
    residuals : (3, 3) array
    status : (3,) int64 array
    contacts : (3,) int64 array
        Smooth contacts of the last step, contacts reflected in steps since the last reset, and programs solved natively
        in all steps. Steps that fail or begin anew count no contacts; all other numbers count all work.
    """

    counts: Annotated[NDArray[np.int64], 2]
    times: Matrix
    residuals: Matrix
    status: Numbers
    contacts: Numbers
