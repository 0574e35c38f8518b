"""Rope through the sheave, and what moves it."""
