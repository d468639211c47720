"""The node that runs the model in force beside the stage and says when the stage is no longer that model.

The watching is that of ``fomrc_core.diagnosis.watch``; here is what it hears, and how it is told.
"""

__all__ = ["node"]
