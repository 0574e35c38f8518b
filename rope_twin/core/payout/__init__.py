"""Payout: material through the sheave, remeshing, and the prescribed motion."""
