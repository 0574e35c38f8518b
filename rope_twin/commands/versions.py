"""Versions of the program, of what it is built on, and of ROS."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Callable

from rope_twin.core import SOLVER_VERSION

DISTRIBUTIONS = {"7": "jazzy", "9": "kilted"}  # of ROS 2, by the first number of rclpy's version
REQUIRED = ("numpy", "numba", "llvmlite", "scipy", "rainflow", "PyYAML", "mcap", "zstandard",
            "rosbags")  # fmt: skip
OPTIONAL = {"rerun-sdk": "viz", "matplotlib": "plot", "pyarrow": "plot", "dask": "study"}


def version_of(package: str) -> str:
    """Return the version of an installed package, or ""."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def ros_distribution() -> str:
    """Return the ROS distribution: that of the sourced installation, else of the wheels, or ""."""
    sourced = os.environ.get("ROS_DISTRO", "")
    return sourced or DISTRIBUTIONS.get(version_of("rclpy").partition(".")[0], "")


def version_text(rmw_name: Callable[[], str]) -> str:
    """Return the lines of `rope_twin --version`; `rmw_name` loads the middleware."""
    packages = ", ".join(
        f"{name} {version_of(name) or 'missing'}" for name in ("numba", "llvmlite")
    )
    return "\n".join(
        (
            f"rope_twin {version_of('rope_twin') or '(not installed)'}, solver {SOLVER_VERSION}",
            f"Python {platform.python_version()}, {packages}",
            _ros_line(rmw_name),
        )
    )


def _ros_line(rmw_name: Callable[[], str]) -> str:
    try:
        rmw = rmw_name()
    except Exception as error:  # an installation may fail in any way, and this line reports it
        return f"rclpy cannot be loaded ({type(error).__name__}: {error})"
    rclpy = version_of("rclpy") or "(of the sourced installation)"
    return f"rclpy {rclpy}, ROS 2 {ros_distribution() or '(unknown distribution)'}, {rmw}"
