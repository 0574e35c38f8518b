"""Table of a sea: properties of its components, and scratch for their cosines and sines.

Like the rows of core/jit/rows they are pointers that LLVM knows not to alias. All properties
are in one table, since a kernel passes ten words for each array. The scratch is on the stack of the
calling kernel: ropes that step on several threads may share their sea. Components come in whole
blocks, the last one padded with components of zero amplitude, so that a sum over blocks has no
remainder.
"""

from __future__ import annotations

from rope_twin.core.jit.rows import stack_rows, table_rows

BLOCK, MOST = 16, 2000  # components per block; maximum per sea

# Rows of a sea's table: one column per component, from long to short,
KX, KY = 0, 1  # wave number east and north [1/m]
OMEGA, PHASE = 2, 3  # [rad/s], [rad]
AMPLITUDE = 4  # [m]
K = 5  # [1/m], ascending
EAST, NORTH, UP = 6, 7, 8  # a·ω/(1 - e^{-2kh}), times cos β, times sin β, and as it is [m/s]
# one column per block of components,
REACH = 9  # below this z [m] the blocks from here on are left out
ECHO = 10  # down to this z [m] its reflection at the bottom is negligible
ASIDE = 11  # range of rotated angles for this number of reaching blocks [m]: one more column
# and one column per level, from the surface down.
LEVEL = 12  # z [m]
THIRD = 13  # of the longest stretch [m] that a cubic can interpolate below it
SEA_ROWS = 14

# Rows of scratch.
COS, SIN = 0, 1  # of each component's angle at the present position
COS_BASE, SIN_BASE = 2, 3  # and at the base position from which angles are rotated:
BASE = 4  # its x, y and surface [m]
SCRATCH_ROWS = 5


# The rows of a sea's table; rows of scratch, with anything in them.
figures = table_rows("sea", SEA_ROWS)
scratch = stack_rows("scratch", (*[MOST] * (SCRATCH_ROWS - 1), 3))
