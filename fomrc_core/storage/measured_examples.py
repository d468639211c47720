"""Measured examples: found on this machine, or fetched once from where their authors published them.

They are looked for in the folder named by the environment variable ``FOMRC_DATA`` or, where that is not set,
in ``../shared/data`` beside the project; then in the user's cache, to which they are fetched. Content is
known by its SHA-256, so that a result quoted for a record is a result on that record.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fomrc_core.errors import DataUnavailableError, ParameterError
from fomrc_core.records.recording import Recording
from fomrc_core.storage import read_recording

_UM_PER_M = 1e6
_PEA_SOURCE = (
    "https://raw.githubusercontent.com/yan9a/DiscreteBacklashOperator/"
    "79fd060d86cdf69be2388e29bf57b0766c273650/MatLabCode/DiscreteBacklashModel/"
)
_FSM_SOURCE = (
    "https://raw.githubusercontent.com/merijnfloren/fsm-benchmark-data/539a12fef384b086a8562b500498b2fa3899ef70/data/"
)


@dataclass(frozen=True)
class MeasuredFile:
    """One file of a data set.

    Attributes:
        name: its name below the data folder, e.g. ``pea_1hz/model.dat``.
        sha256: of its content, as kept beside the project.
        url: where its authors published it; may be longer than the file kept beside the project.
        url_sha256: of what is there.
    """

    name: str
    sha256: str
    url: str
    url_sha256: str


@dataclass(frozen=True)
class MeasuredSet:
    """A measured example.

    Attributes:
        name: what to call it.
        description: actuator and excitation in a line.
        licence: licence and owner.
        files: what it consists of.
    """

    name: str
    description: str
    licence: str
    files: tuple[MeasuredFile, ...]


def _published_whole(name: str, url: str, sha256: str) -> MeasuredFile:
    return MeasuredFile(name, sha256, url, sha256)


PEA_1HZ = MeasuredSet(
    "pea_1hz",
    "PI PICMA P-885.91 stack, 200 Hz: 40 s of a 1 Hz sine; 25 s of growing and decaying sines and a hold",
    "MIT, (c) 2019 Yan Naing Aye",
    (
        _published_whole(
            "pea_1hz/model.dat",
            _PEA_SOURCE + "Model_Vi_Do.dat",
            "672714f09302b892721aa44d72f337a7ee1a0eb1d107f4d6797ab47d849428ae",
        ),
        MeasuredFile(
            "pea_1hz/test_first_25s.dat",
            "0a34eb96fff146e0d78968c0347aa47dda6ecaf32aed8c73d0589f858030e9a6",
            _PEA_SOURCE + "Test_Vi_Do_Di.dat",
            "6c33cb76d3f6e12f5074626710f71aeb43d8411a5ad0a56469ad01904221aae5",
        ),
    ),
)
FSM = MeasuredSet(
    "fsm",
    "CubeSpec fine steering mirror, three piezo axes, 6400 Hz: random-phase multisines 0.78-2999 Hz",
    "CC BY 4.0, (c) 2025 Merijn Floren, KU Leuven",
    tuple(
        _published_whole(f"fsm/{name}", _FSM_SOURCE + name, sha256)
        for name, sha256 in {
            "u_100mV_train.npy": "a53d6ee47ac1ea784c70e7634ce816467fb61effd8706eaf6b52f68142380a81",
            "u_300mV_train.npy": "0436437998307e8f8c86f824c1fee4e225f212861878bf58d42b2a5e2ecd0cb5",
            "y_100mV_train.npy": "06892ff7fc943712898d7ca741205e4d6574bec2a20e69a0052f986c27bd10ad",
            "y_300mV_train.npy": "38acb224027e728d7a3c44a0ce5538fcb74c836be585a1b318a6728c8a6820fb",
        }.items()
    ),
)
DATA_SETS: dict[str, MeasuredSet] = {measured.name: measured for measured in (PEA_1HZ, FSM)}


def locate(name: str) -> tuple[Path, ...]:
    """Return where the files of a data set are, fetching those that are not on this machine.

    Args:
        name: of the data set, see ``DATA_SETS``.

    Raises:
        ParameterError: no data set of that name.
        DataUnavailableError: neither on this machine nor to be fetched, or of other content than known.
    """
    if name not in DATA_SETS:
        raise ParameterError("no such data set", where="data", value=name, allowed=", ".join(DATA_SETS))
    return tuple(_local(file) or _fetched(file) for file in DATA_SETS[name].files)


def pea_1hz() -> tuple[Recording, Recording]:
    """Return the piezo stack's records: 40 s to fit on, 25 s to test on.

    The state before the first sample is not known; the displacement has an arbitrary offset.

    Raises:
        DataUnavailableError: see ``locate``.
    """
    columns = {"time": None, "voltage": 0, "displacement": 4}
    train, test = (read_recording(path, columns=columns, rate_hz=200.0) for path in locate("pea_1hz"))
    # What is published is the whole test record; its later part is not used here.
    test = test.window(0.0, 25.0)
    return replace(train, name="pea_1hz model.dat"), replace(test, name="pea_1hz test_first_25s.dat")


def fsm(*, amplitude_mv: int = 100, realisation: int = 0, axis: int = 0, cross_axis: int = 1) -> Recording:
    """Return a record of the fine steering mirror: two periods of one realisation, on one axis.

    All three axes move at a time, on frequencies of their own; another axis is given as the cross axis.

    Args:
        amplitude_mv: 100 or 300.
        realisation: 0 to 5.
        axis: 0 to 2.
        cross_axis: 0 to 2, another than ``axis``.

    Raises:
        ParameterError: an argument outside what is allowed.
        DataUnavailableError: see ``locate``.
    """
    if amplitude_mv not in (100, 300):
        raise ParameterError("no such amplitude", where="amplitude_mv", value=amplitude_mv, allowed="100 or 300")
    if realisation not in range(6):
        raise ParameterError("no such realisation", where="realisation", value=realisation, allowed="0..5")
    if axis not in range(3) or cross_axis not in range(3) or axis == cross_axis:
        raise ParameterError(
            "no such pair of axes", where="axis, cross_axis", value=(axis, cross_axis), allowed="two of 0, 1, 2"
        )
    paths = {path.name: path for path in locate("fsm")}
    # (samples, axes, realisations, periods) -> (samples of all periods, axes)
    voltage_v, displacement_m = (
        np.concatenate(np.moveaxis(np.load(paths[f"{quantity}_{amplitude_mv}mV_train.npy"])[:, :, realisation], 2, 0))
        for quantity in "uy"
    )
    return Recording(
        np.arange(voltage_v.shape[0]) / 6400.0,
        voltage_v[:, axis],
        displacement_m[:, axis] * _UM_PER_M,
        cross_voltage_v=voltage_v[:, cross_axis],
        cross_displacement_um=displacement_m[:, cross_axis] * _UM_PER_M,
        name=f"fsm {amplitude_mv} mV realisation {realisation} axis {axis}",
    )


def _data_folders() -> tuple[Path, ...]:
    named = os.environ.get("FOMRC_DATA")
    if named:
        return (Path(named).expanduser(),)
    beside_source = Path(__file__).resolve().parents[2].parent
    return tuple(dict.fromkeys(parent / "shared" / "data" for parent in (beside_source, Path.cwd().parent)))


def _local(file: MeasuredFile) -> Path | None:
    for folder in _data_folders():
        path = folder / file.name
        if not path.is_file():
            continue
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise DataUnavailableError(f"{path}: cannot be read ({error.strerror})") from None
        if found not in (file.sha256, file.url_sha256):
            raise DataUnavailableError(
                f"{path}: not the known record (SHA-256 {found[:12]}..., not {file.sha256[:12]}...)"
            )
        return path
    return None


def _fetched(file: MeasuredFile) -> Path:
    try:
        import pooch
    except ImportError:
        raise DataUnavailableError(
            f"{file.name} is not on this machine, and fetching it needs the package pooch (pip install pooch)"
        ) from None
    pooch.get_logger().setLevel("WARNING")
    try:
        return Path(
            pooch.retrieve(
                file.url,
                known_hash=f"sha256:{file.url_sha256}",
                path=pooch.os_cache("fomrc") / Path(file.name).parent,
                fname=file.url.rpartition("/")[2],
                downloader=pooch.HTTPDownloader(timeout=15),
            )
        )
    except Exception as error:
        # No network shows as any of a dozen exceptions of the layers below; a wrong content as ValueError.
        is_offline = "retries exceeded" in str(error) or "timed out" in str(error)
        reason = "no connection" if is_offline else (str(error).splitlines() or [type(error).__name__])[0]
        raise DataUnavailableError(
            f"{file.name} is neither in {' or '.join(map(str, _data_folders()))}, "
            f"nor to be had from {file.url} ({reason})"
        ) from None
