"""One implicit stage of a rope: prediction, assembly, and the direct solver."""
