"""Recordings as other programs write them: oscilloscopes, spreadsheets, MATLAB, HDF5, LabVIEW.

What the columns are and in which units is read from their headers; what the file does not say is asked for.
"""

from fomrc_core.storage.foreign.binary_tables import is_binary_table, read_binary_table
from fomrc_core.storage.foreign.headers import Meaning, meanings_of, told_units
from fomrc_core.storage.foreign.raw_columns import RawColumns
from fomrc_core.storage.foreign.text_layout import read_text_table
from fomrc_core.storage.foreign.understanding import Understood, understand

__all__ = [
    "Meaning",
    "RawColumns",
    "Understood",
    "is_binary_table",
    "meanings_of",
    "read_binary_table",
    "read_text_table",
    "told_units",
    "understand",
]
