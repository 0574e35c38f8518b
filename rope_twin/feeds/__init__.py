"""Instrument feeds: telegrams of line monitors and motion sensors as samples in SI, without ROS."""
