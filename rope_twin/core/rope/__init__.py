"""Elements of a rope: sections, tension law, stiffness."""
