"""A run's options, inputs, progress and summary, and the run without ROS."""
