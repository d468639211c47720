"""Hysteresis and creep of piezo actuators: simulate, invert, fit, and ask where the model is wrong."""
