"""What every node of the package shares: parameters and their files, runtime, diagnostics, quality of service.

Nothing here knows which node it is part of.
"""

__all__ = [
    "diagnostics",
    "inbox",
    "jobs",
    "lifecycle_log",
    "model_parameters",
    "other_publishers",
    "parameter_files",
    "parameters",
    "quality_of_service",
    "runtime",
    "sender",
    "voltage_interface",
    "voltage_parameters",
    "work",
    "worker_process",
]
