"""Whether a stage in service is still its model: the model beside it, a sequential test, and what has changed.

``model_watch.ModelWatch`` is the way in, ``alarm.Alarm`` what it raises; ``naming.name_case`` says what it was about.
"""

__all__ = ["alarm", "model_watch", "naming"]
