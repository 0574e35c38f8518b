"""Validation of rope_twin from a clone: published and closed-form cases, and hard cases."""
