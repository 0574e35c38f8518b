"""One implicit stage: prediction, assembly, and the direct solve."""
