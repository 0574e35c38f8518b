"""Nodes of the suite: everything that needs rclpy.

The matrices of learning and forecasts are small: more threads of OpenBLAS gain nothing, and take
the cores from the thread that steps the rope. It reads the variable when numpy is loaded.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
