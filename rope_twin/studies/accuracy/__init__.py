"""What accuracy costs a scene, and its card: `rope_twin accuracy`."""
