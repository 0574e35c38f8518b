"""SIMD batch: several ropes, or systems of ropes, stepped at once by the kernels of one."""
