import os

from setuptools import find_packages, setup

package_name = "fomrc_ros"


def shared(folder):
    """Return the files of a folder and its subfolders, as they are to lie in the share folder."""
    for path, _, files in sorted(os.walk(folder)):
        kept = sorted(
            os.path.join(path, name) for name in files if not name.startswith(".") and not name.endswith(".pyc")
        )
        if kept:
            yield f"share/{package_name}/{path}", kept


extras = {
    # A ROS installation brings its own rclpy; these wheels are for machines without one
    # (CPython 3.10-3.14 on x86-64 Linux).
    "ros": [
        "ros-rclpy[fastrtps]>=7.1",
        "ros-std-msgs",
        "ros-std-srvs",
        "ros-sensor-msgs",
        "ros-diagnostic-msgs",
        "ros-lifecycle-msgs",
        "ros-trajectory-msgs",
        "ros-rcl-interfaces",
    ],
    # Kept for who asks for it by its old name: numba is part of the base.
    "fast": [],
    "bags": ["rosbags>=0.10"],
    # Files of other programs: parquet, Excel, HDF5 and MATLAB 7.3, LabVIEW. Text, .npz and .mat need none of it.
    "formats": ["pandas>=1.5", "pyarrow>=10", "openpyxl>=3.0", "h5py>=3.7", "npTDMS>=1.6"],
    # colcon recognises the test framework by 'pytest' in an extra of this name.
    "test": [
        "pytest>=8",
        "pytest-xdist>=3.5",
        "hypothesis>=6.100",
        "distributed>=2023.1",
        "sybil>=6",
        "axe-core-python>=0.1",
        # tables that recordings are made of
        "pandas>=1.5",
        "xarray>=2023.1",
    ],
    "bench": ["pytest-benchmark>=4"],
    # The site: its notebooks are executed, and begin with pandas.
    "docs": [
        "mkdocs-material>=9.5",
        "mkdocstrings[python]>=0.25",
        "mkdocs-jupyter>=0.24",
        "jupytext>=1.16",
        "ipykernel>=6",
        "pandas>=1.5",
    ],
    "lint": ["ruff>=0.6", "mypy>=1.10", "types-PyYAML"],
}
extras["all"] = sorted({requirement for group in extras.values() for requirement in group})

setup(
    name=package_name,
    version="0.1.0",
    description="Hysteresis and creep of piezo actuators: simulate, invert, fit, find what a model misses",
    license="Apache-2.0",
    maintainer="fomrc maintainers",
    maintainer_email="maintainers@users.noreply.h-seed-39e1938a.example",
    python_requires=">=3.10",
    package_data={
        "fomrc_core": ["py.typed"],
        "fomrc_core.report": ["templates/*"],
        "fomrc_core.export": ["templates/*"],
    },
    packages=find_packages(include=["fomrc_core", "fomrc_core.*", "fomrc_ros", "fomrc_ros.*"]),
    install_requires=[
        "setuptools",
        "numpy>=1.23",
        "scipy>=1.10",
        "numba>=0.59",
        "PyYAML>=6.0",
        "matplotlib>=3.6",
        # of the pages: its JavaScript is what they carry; without it they have pictures only
        "bokeh>=3.4",
        "typer>=0.12",
        "rich>=13",
        "pooch>=1.7",
        "threadpoolctl>=3",
    ],
    extras_require=extras,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        *shared("config"),
        *shared("launch"),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "fomrc = fomrc_core.cli:main",
            "compensator = fomrc_ros.compensator.node:main",
            "simulated_pea = fomrc_ros.simulated_stage.node:main",
            "identification = fomrc_ros.identification.node:main",
            "watch = fomrc_ros.watch.node:main",
            "gap_command = fomrc_ros.gap.nodes:command_main",
            "gap_monitor = fomrc_ros.gap.nodes:monitor_main",
        ],
    },
)
