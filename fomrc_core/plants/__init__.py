"""Piezo stages simulated from other physics than the model's: truths to try the model on.

They share no code and no form with the model that is fitted to them.
"""

__all__ = ["electromechanical", "paper_stage", "simulated_rig"]
