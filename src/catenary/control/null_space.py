"""Damping of the motions of an arm that do not move its point, for `CartesianImpedance`."""

from __future__ import annotations

import math

from catenary.control.compiles import Row, compiles
from catenary.control.kinematics import COLUMNS, FIRST, JOINT, JOINTS, MATRIX, SOLVER

REGULARIZATION = 1e-8  # of J Jᵀ [m², or rad²], so that it is invertible in a singularity
# layout of the parameters of `CartesianImpedance`: kind, stiffness (6), damping (6), two limits,
# then the limit and the damping of each axis
STIFFNESS, DAMPING, LIMITS, AXIS = 1, 7, 13, 15
GAINS = 2


@compiles
def project(memory: Row, work: int, parameters: Row, velocity: Row, torque: Row) -> None:
    """Add (I - Jᵀ (J Jᵀ + ε I)⁻¹ J) τ₀ with τ₀ = -D q̇ to `torque`.

    J has only the directions with stiffness or damping. The others belong to the null space.
    """
    n = len(velocity)
    damped = False
    for i in range(n):
        damped = damped or parameters[AXIS + GAINS * i + 1] > 0.0
    if not damped:
        return
    fill(memory, work, parameters, velocity)
    solve(memory, work + SOLVER)
    solution = work + SOLVER + MATRIX
    for i in range(n):
        torque[i] -= parameters[AXIS + GAINS * i + 1] * velocity[i]
    for j in range(int(memory[JOINTS])):
        column = work + COLUMNS + 6 * j
        total = 0.0
        for k in range(6):
            total += memory[column + k] * memory[solution + k]
        torque[int(memory[FIRST + JOINT * j])] -= total


@compiles
def fill(memory: Row, work: int, parameters: Row, velocity: Row) -> None:
    """Write J Jᵀ + ε I and J τ₀ to the solver. A direction without a spring gets the result 0."""
    matrix, right, columns = work + SOLVER, work + SOLVER + MATRIX, work + COLUMNS
    for r in range(6):
        used = controlled(parameters, r)
        memory[right + r] = 0.0
        for c in range(6):
            both = used and controlled(parameters, c)
            total = 1.0 if r == c and not used else 0.0
            for j in range(int(memory[JOINTS]) if both else 0):
                total += memory[columns + 6 * j + r] * memory[columns + 6 * j + c]
            memory[matrix + 6 * r + c] = total
        memory[matrix + 7 * r] += REGULARIZATION
        for j in range(int(memory[JOINTS]) if used else 0):
            axis = int(memory[FIRST + JOINT * j])
            own = -parameters[AXIS + GAINS * axis + 1] * velocity[axis]
            memory[right + r] += memory[columns + 6 * j + r] * own


@compiles
def controlled(parameters: Row, k: int) -> bool:
    """Return True if direction `k` has stiffness or damping."""
    return bool(parameters[STIFFNESS + k] > 0.0 or parameters[DAMPING + k] > 0.0)


@compiles
def solve(memory: Row, at: int) -> None:
    """Solve a symmetric positive definite system of 6 equations by Cholesky, in place.

    The matrix is at `at`, by rows. The right side after it becomes the solution.
    """
    right = at + MATRIX
    for i in range(6):
        for j in range(i + 1):
            total = memory[at + 6 * i + j]
            for k in range(j):
                total -= memory[at + 6 * i + k] * memory[at + 6 * j + k]
            root = i == j
            memory[at + 6 * i + j] = math.sqrt(total) if root else total / memory[at + 7 * j]
        for k in range(i):
            memory[right + i] -= memory[at + 6 * i + k] * memory[right + k]
        memory[right + i] /= memory[at + 7 * i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            memory[right + i] -= memory[at + 6 * k + i] * memory[right + k]
        memory[right + i] /= memory[at + 7 * i]
