"""Result of a rule of scenes."""

from __future__ import annotations

Fault = tuple[str, str, str]  # path in the scene's file, fault, remedy
