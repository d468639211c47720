"""What a diagnosis or a fit says, for people: pictures, a page, JSON.

Nothing is computed here that a number elsewhere depends on.
"""

__all__ = [
    "axes_diagnosis_files",
    "axes_fit_results",
    "change_files",
    "check_results",
    "diagnosis_files",
    "diagnosis_fleet",
    "diagnosis_names",
    "drive_to_add",
    "fit_results",
    "provenance",
    "recording_check",
    "recording_figure",
    "view_pages",
]
