"""Whether a stage in service is still its model: the model beside it, a sequential test, and what has changed.

``model_watch.ModelWatch`` is the way in; ``naming.name_case`` says what an alarm was about.
"""

__all__ = ["model_watch", "naming"]
