"""SIMD batch: several ropes stepped at once, one per lane, by the kernels of one rope."""
