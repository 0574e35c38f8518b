"""A process of its own (NUMBA_DISABLE_JIT=1): the results of effect_cases into an .npz file.

With a second one, which holds where rigid bodies rest, the results of the long run.
"""

from __future__ import annotations

import sys

import numpy as np
from effect_cases import of_always, of_minutes

if __name__ == "__main__":
    if len(sys.argv) > 2:
        with np.load(sys.argv[2]) as rest:
            found = of_minutes(dict(rest))
    else:
        found = of_always()
    np.savez(sys.argv[1], allow_pickle=False, **found)
