"""Many lifts that differ in a few numbers: `rope_twin ensemble`."""
