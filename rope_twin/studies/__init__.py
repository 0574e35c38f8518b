"""Studies of a user's own scene: the bodies of commands."""
