"""What a diagnosis or a fit says, for people: pictures, a page, JSON.

Nothing is computed here that a number elsewhere depends on.
"""

__all__ = [
    "change_files",
    "diagnosis_files",
    "diagnosis_fleet",
    "fit_results",
    "recording_figure",
]
