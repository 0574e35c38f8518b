"""Packaging for both worlds: pip (wheels from the Python index) and colcon (ament_python)."""

import os
from pathlib import Path

from setuptools import find_packages, setup

NAME = "rope_twin"
HERE = Path(__file__).resolve().parent

REQUIRES = [
    "numpy>=2.0",
    "numba>=0.66,<0.69",  # versions that .ci/numba has tested: core/jit uses private parts
    "scipy>=1.11",
    "pyyaml>=6.0",
    "mcap>=1.6",
    "zstandard>=0.22",
    "rosbags>=0.11,<0.12",
    "pyserial>=3.5",  # feeds from serial lines
]
# Under a sourced ROS installation rclpy is the system's; elsewhere it comes as wheels.
ROS_WHEELS = ["ros-rclpy[fastrtps]==9.1.2", "ros-common-interfaces==5.5.1"]
if "AMENT_PREFIX_PATH" not in os.environ:
    REQUIRES += ROS_WHEELS

VIZ = ["rerun-sdk==0.41.0", "pillow>=10"]
PLOT = ["matplotlib>=3.8", "pyarrow>=14"]  # pictures, and tables as Parquet
MODBUS = ["pymodbus>=3.13"]  # feeds from a PLC
OPCUA = ["asyncua>=2"]  # feeds from an OPC UA server; LGPL-3.0, so an extra that nothing needs
STUDY = ["dask>=2024.8", "distributed>=2024.8", *PLOT]  # `rope_twin study`, on clusters too
# `rope_twin plan`: its report, its results as netCDF, and RAOs from netCDF files of Capytaine
PLANNING = ["jinja2>=3.1", "h5netcdf[h5py]>=1.4", "xarray>=2025.1", "typst>=0.14", *PLOT]
SENSITIVITY = ["SALib>=1.5"]  # `rope_twin sensitivity`: designs and indices of Morris and Sobol
HYDRODYNAMICS = ["capytaine>=2.2"]  # GPL-3.0, so an extra that nothing needs
FMU = ["pythonfmu3>=0.3.4"]  # FMU 3.0 export of scenes
# the operator console: in browsers, and by Textual in a terminal
CONSOLE = ["starlette>=0.46", "uvicorn>=0.35", "websockets>=14", "textual>=8"]
DOCS = [
    "sphinx>=8,<10",
    "furo>=2025.12",
    "myst-nb>=1.4,<2",
    "latex2mathml>=3.77",  # formulas without a network
    "nbclient>=0.10",
    "ipykernel>=6",
]
TEST = [
    "pytest>=8,<9.2",  # with 9.2 pytest-xdist 3.8 does not see groups: tests over ROS would overlap
    "pytest-xdist>=3.8",  # --no-loadscope-reorder
    "hypothesis>=6.100",
    "jsonschema>=4.20",  # scenes are checked against `rope_twin scene schema`
    "psutil>=5.9",
    "pypdfium2>=4.30",  # words of the PDF report
    "rainflow>=3.2,<4",  # the count of cycles is checked against it
    "cyclonedds==11.0.1",
    "ruff==0.15.*",
    "mypy>=1.10",
    "types-PyYAML",
    "httpx2>=2",  # requests of Starlette's test client
    "playwright>=1.50",  # the console in a browser, where there is Chromium
    "axe-playwright-python>=0.1.8",  # axe-core for it
    *VIZ,
    *CONSOLE,
    *MODBUS,
    *OPCUA,
    *STUDY,
    *PLANNING,
    *SENSITIVITY,
    *FMU,
    "fmpy>=0.3.20",  # runs FMUs
    *DOCS,
]


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """The data files below a folder, as pairs of install directory and files."""
    pairs = {}
    for path in sorted((HERE / folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            relative = path.relative_to(HERE)
            pairs.setdefault(f"share/{NAME}/{relative.parent}", []).append(str(relative))
    return list(pairs.items())


setup(
    name=NAME,
    version="0.1.0",
    description="A real-time digital twin of the lifting rope, as a ROS 2 node suite",
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="BSD-3-Clause",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: ["py.typed", "console/page/*", "console/page/*/*", "planning/*.j2", "planning/*.typ"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *shared("config"),
        *shared("bags"),
        *shared("launch"),
    ],
    install_requires=REQUIRES,
    extras_require={
        "viz": VIZ,
        "plot": PLOT,
        "console": CONSOLE,
        "modbus": MODBUS,
        "opcua": OPCUA,
        "study": STUDY,
        "planning": PLANNING,
        "sensitivity": [*PLANNING, *SENSITIVITY],
        "hydrodynamics": HYDRODYNAMICS,
        "fmu": FMU,
        "docs": DOCS,
        "test": TEST,
        "dev": [*TEST, "colcon-common-extensions", "build", "pre-commit"],
    },
    entry_points={
        "console_scripts": [
            "rope_twin = rope_twin.cli:main",
            "simulation_node = rope_twin.ros.simulation_node:main",
            "sea_state_node = rope_twin.ros.sea_state_node:main",
            "winch_schedule_node = rope_twin.ros.winch_schedule_node:main",
            "feed_node = rope_twin.ros.feed_node:main",
            "recorder_node = rope_twin.ros.recorder_node:main",
            "viewer_node = rope_twin.ros.viewer_node:main",
            "console_node = rope_twin.ros.console_node:main",
            "forecast_node = rope_twin.ros.forecast_node:main",
        ]
    },
)
