"""Tables of other programs: NumPy, MATLAB, HDF5, parquet, Excel, LabVIEW; each through its own kept-up library."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import StorageError
from fomrc_core.storage.foreign.raw_columns import RawColumns

_N_ROWS_AT_ONCE = 1 << 18  # of a table that is read in parts

_Series = Iterator[tuple[str, str, Any]]


def is_binary_table(path: Path) -> bool:
    """Return whether a file is by its name one of the tables read here."""
    return path.suffix.lower() in _READERS


def read_binary_table(path: Path) -> RawColumns:
    """Return the columns of a file; those of the most common length where there are several.

    Raises:
        StorageError: no such file, one that cannot be read, a library that is missing, or no columns of numbers.
    """
    where, suffix = str(path), path.suffix.lower()
    if not path.is_file():
        raise StorageError("no such file", where=where)
    try:
        series = [(name, unit, np.squeeze(np.asarray(values))) for name, unit, values in _READERS[suffix](path)]
    except ImportError as error:
        raise StorageError(
            f"{suffix} files need the library {error.name}", where=where, allowed="pip install 'fomrc_ros[formats]'"
        ) from None
    except Exception as error:  # whatever a library makes of a broken file
        line = (str(error).splitlines() or [type(error).__name__])[0]
        raise StorageError(f"cannot be read as {suffix}", where=where, value=line) from None
    columns = list(_flat(series))
    if not columns:
        raise StorageError("no columns of numbers", where=where, allowed="two or more of equal length")
    lengths = [values.size for _, _, values in columns]
    length = max(set(lengths), key=lambda n: (lengths.count(n), n))
    kept = [column for column in columns if column[2].size == length]
    values = np.stack([np.asarray(v, dtype=np.float64) for _, _, v in kept])
    return RawColumns(where, tuple(n for n, _, _ in kept), tuple(u for _, u, _ in kept), values, f"{suffix} file")


def _flat(series: list[tuple[str, str, Any]]) -> _Series:
    for name, unit, values in series:
        if values.dtype.kind == "M":
            values = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
            unit = "s"
        if values.dtype.kind not in "fiu" or values.size < 2:
            continue
        if values.ndim == 1:
            yield name, unit, values
        elif values.ndim == 2:
            table = values if values.shape[0] > values.shape[1] else values.T
            for k in range(table.shape[1]):
                yield f"{name}{k}" if table.shape[1] > 1 else name, unit, table[:, k]


def _npz(path: Path) -> _Series:
    with np.load(path, allow_pickle=False) as held:
        if isinstance(held, np.ndarray):
            yield "", "", held
            return
        for name in held.files:
            yield name, "", held[name]


def _npy(path: Path) -> _Series:
    yield "", "", np.load(path, allow_pickle=False)


def _mat(path: Path) -> _Series:
    from scipy.io import loadmat

    try:
        held: Mapping[str, Any] = loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:  # version 7.3 is HDF5
        yield from _hdf5(path)
        return
    for name, values in held.items():
        array = np.asarray(values)
        if array.dtype.names:
            for field in array.dtype.names:
                yield field, "", np.asarray(array[field].item() if array.shape == () else array[field])
        elif not name.startswith("__"):
            yield name, "", array


def _hdf5(path: Path) -> _Series:
    import h5py

    found: list[tuple[str, str, Any]] = []

    def keep(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "fiu" and node.size > 1:
            unit = next((node.attrs[key] for key in ("unit", "units", "Unit", "Units") if key in node.attrs), "")
            found.append((name.rpartition("/")[2], unit.decode() if isinstance(unit, bytes) else str(unit), node[()]))

    with h5py.File(path, "r") as held:
        held.visititems(keep)
    yield from found


def _parquet(path: Path) -> _Series:
    from pyarrow import types
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        columns: dict[str, Any] = {}
        for field in file.schema_arrow:
            # pandas numbers the rows in a column of its own where they have no other index
            if not field.name.startswith("__index_level_"):
                if types.is_integer(field.type) or types.is_floating(field.type):
                    columns[field.name] = np.empty(file.metadata.num_rows)
                elif types.is_timestamp(field.type):
                    columns[field.name] = np.empty(file.metadata.num_rows, dtype="datetime64[ns]")
        at = 0
        for batch in file.iter_batches(_N_ROWS_AT_ONCE, columns=list(columns)):
            for name, values in columns.items():
                values[at : at + batch.num_rows] = batch.column(name).to_numpy(zero_copy_only=False)
            at += batch.num_rows
            beat("rows", batch.num_rows)
    for name, values in columns.items():
        yield name, "", values


def _excel(path: Path) -> _Series:
    import pandas

    frame = pandas.read_excel(path)
    for name in frame.columns:
        yield str(name), "", frame[name].to_numpy()


def _tdms(path: Path) -> _Series:
    from nptdms import TdmsFile

    for group in TdmsFile.read(path).groups():
        for channel in group.channels():
            values = channel[:]
            step = channel.properties.get("wf_increment")
            if step:
                yield "time", "s", np.arange(len(values)) * float(step)
            yield channel.name, str(channel.properties.get("unit_string", "")), values


_READERS: dict[str, Callable[[Path], _Series]] = {
    ".npz": _npz,
    ".npy": _npy,
    ".mat": _mat,
    ".h5": _hdf5,
    ".hdf5": _hdf5,
    ".parquet": _parquet,
    ".xlsx": _excel,
    ".tdms": _tdms,
}
