"""Rows of a sea: figures of its components, and scratch for their cosines and sines.

Like the rows of core/jit/rows they are pointers that LLVM knows to lie apart. All figures are
in one table, since a kernel hands on ten words for each array. The scratch is on the stack of the
kernel that asks for it: ropes that step on several threads may share their sea. Components come in
whole blocks, the last one filled up with some of no amplitude, so that a sum over blocks has no
remainder to take one by one.
"""

from __future__ import annotations

from rope_twin.core.jit.rows import stack_rows, table_rows

BLOCK, MOST = 16, 2000  # components of a block; of a sea

# Rows of a sea's table: a column each component, from long to short,
KX, KY = 0, 1  # wave number east and north [1/m]
OMEGA, PHASE = 2, 3  # [rad/s], [rad]
AMPLITUDE = 4  # [m]
K = 5  # [1/m], rising
EAST, NORTH, UP = 6, 7, 8  # a·ω/(1 - e^{-2kh}), times cos β, times sin β, and as it is [m/s]
# a column each block of them,
REACH = 9  # below this z [m] the blocks from here on are left out
ECHO = 10  # down to this z [m] the bottom throws back nothing of it
ASIDE = 11  # how far angles may be turned where so many blocks reach [m]: one column more
# and a column each level, from the surface down.
LEVEL = 12  # z [m]
THIRD = 13  # of the longest stretch [m] that a cubic serves below it
SEA_ROWS = 14

# Rows of scratch.
COS, SIN = 0, 1  # of each component's angle at the place in question
COS_BASE, SIN_BASE = 2, 3  # and at the place from which angles are turned:
BASE = 4  # its x, y and surface [m]
SCRATCH_ROWS = 5


# The rows of a sea's table; rows of scratch, with anything in them.
figures = table_rows("sea", SEA_ROWS)
scratch = stack_rows("scratch", (*[MOST] * (SCRATCH_ROWS - 1), 3))
