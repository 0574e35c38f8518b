"""What a rule of scenes finds wrong."""

from __future__ import annotations

Fault = tuple[str, str, str]  # path in the scene's file, what is wrong, what would be right
