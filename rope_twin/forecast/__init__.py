"""Forecast of the next minute: heave, tension, risk, orders compared, and their scores."""
