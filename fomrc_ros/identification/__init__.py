"""The node that identifies, diagnoses and calibrates a stage, in a process of its own.

The work is that of ``fomrc_core``; here is how it is asked for and reported.
"""

__all__ = ["compensator_client", "node", "stage_recorder"]
