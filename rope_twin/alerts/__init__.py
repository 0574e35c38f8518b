"""Alerts: conditions on the lift, the state of each alert, and how often alerts come."""
