"""What is measured of the solver itself, over the shipped scenes: the bodies of commands."""
