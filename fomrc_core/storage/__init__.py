"""Recordings and models in files: CSV, plain columns, rosbag2 folders, YAML.

Everything that is wrong with a file is told as one :class:`fomrc_core.errors.StorageError` line naming the
file, the line or field, the value found and what is allowed. What looks at records (``reading``) or knows of several
axes (``axes_files``) is imported by itself: a model alone does not wait for it.
"""

from fomrc_core.storage.atomic import make_directory, write_text
from fomrc_core.storage.bags import write_bag
from fomrc_core.storage.model_files import model_to_parameters, read_fit_error, read_model, write_model
from fomrc_core.storage.output_paths import check_outputs, files_in
from fomrc_core.storage.recordings import read_recording, read_target, write_columns, write_recording

__all__ = [
    "atomic",
    "axes_files",
    "check_outputs",
    "files_in",
    "foreign",
    "kept_work",
    "make_directory",
    "measured_examples",
    "model_to_parameters",
    "plain_yaml",
    "read_fit_error",
    "read_model",
    "read_recording",
    "read_target",
    "reading",
    "record_work",
    "told_columns",
    "write_bag",
    "write_columns",
    "write_model",
    "write_recording",
    "write_text",
]
