"""A model and its inverse as C99 or as one Python file, for controllers that know nothing of this package.

The files hold tables of constants and the same steps; each export carries a self-test with answers of the model.
"""

from fomrc_core.export.exporting import Export, export_model
from fomrc_core.export.options import Direction, ExportOptions, Language, Precision, choice, name_from
from fomrc_core.export.self_test import SelfTest, SelfTestError, run_self_test

__all__ = [
    "Direction",
    "Export",
    "ExportOptions",
    "Language",
    "Precision",
    "SelfTest",
    "SelfTestError",
    "choice",
    "export_model",
    "name_from",
    "run_self_test",
]
