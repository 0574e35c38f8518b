"""A process of its own (NUMBA_DISABLE_JIT=1): the results of effect_cases into an .npz file.

A second one tells where rigid bodies rest.
"""

from __future__ import annotations

import sys

import numpy as np
from effect_cases import everything

if __name__ == "__main__":
    with np.load(sys.argv[2]) as rest:
        np.savez(sys.argv[1], allow_pickle=False, **everything(dict(rest)))
