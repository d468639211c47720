"""Recordings and models in files: CSV, plain columns, rosbag2 folders, YAML.

Everything that is wrong with a file is told as one :class:`fomrc_core.errors.StorageError` line naming the
file, the line or field, the value found and what is allowed.
"""

from fomrc_core.storage.atomic import make_directory, write_text
from fomrc_core.storage.axes_files import (
    AxesRecording,
    read_axes_model,
    read_axes_recording,
    write_axes_model,
)
from fomrc_core.storage.bags import write_bag
from fomrc_core.storage.model_files import model_to_parameters, read_fit_error, read_model, write_model
from fomrc_core.storage.output_paths import check_outputs, files_in
from fomrc_core.storage.reading import ReadingOptions, ReadRecord, read_as, understood_file
from fomrc_core.storage.recordings import read_recording, read_target, write_columns, write_recording

__all__ = [
    "AxesRecording",
    "ReadRecord",
    "ReadingOptions",
    "atomic",
    "check_outputs",
    "files_in",
    "foreign",
    "make_directory",
    "measured_examples",
    "model_to_parameters",
    "plain_yaml",
    "read_as",
    "read_axes_model",
    "read_axes_recording",
    "read_fit_error",
    "read_model",
    "read_recording",
    "read_target",
    "record_work",
    "told_columns",
    "understood_file",
    "write_axes_model",
    "write_bag",
    "write_columns",
    "write_model",
    "write_recording",
    "write_text",
]
