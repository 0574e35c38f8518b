"""Two lines around one sheave: how near they come, where they cross, what they carry."""
