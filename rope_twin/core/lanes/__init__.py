"""Several ropes stepped at once, one in each SIMD lane: the kernels of one rope on wide numbers."""
