"""The node that takes a desired position and publishes the voltage that gives it.

The loop itself is ``fomrc_core.control``; here are its topics, parameters, services and diagnostics.
"""

__all__ = ["node"]
