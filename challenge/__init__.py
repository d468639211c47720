"""A challenge: records of piezo actuators with effects hidden in them, and the scoring of anyone's answers.

Uses the second hidden world (test/hidden/second) and nothing of the product that may take part.
"""
