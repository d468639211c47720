"""A joint that gives way before what rings or behind it, and what rings in the drive or in the stage."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects import in_chain_order
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.lost_preload import LostPreload
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps

MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02, substeps=Substeps.BENDS)


def uneven() -> tuple[np.ndarray, np.ndarray]:
    """Return uneven steps [s] and a random drive [V], shape (120,)."""
    rng = np.random.default_rng(23)
    return 2e-3 * (1.0 + 0.5 * rng.uniform(-1.0, 1.0, 120)), rng.standard_normal(120)


@pytest.mark.parametrize(
    ("behind_masses", "order"),
    [
        (0.0, ["lost_preload", "mechanical_resonance", "sensor_bandwidth"]),
        (1.0, ["mechanical_resonance", "lost_preload", "sensor_bandwidth"]),
    ],
)
def test_a_joint_gives_way_before_the_masses_or_behind_them(behind_masses: float, order: list[str]) -> None:
    joint = LostPreload(0.01, 0.25, behind_masses)
    chain = in_chain_order((SensorBandwidth(300.0), joint, MechanicalResonance(90.0, 0.05)))
    assert [effect.name for effect in chain] == order
    assert joint.other_forms() == [LostPreload(0.01, 0.25, 1.0 - behind_masses)]
    steps_s, drive_v = uneven()
    ringing = MODEL.with_effects(MechanicalResonance(90.0, 0.05))
    bent = joint.run(joint.initial_state(), ringing.simulate(steps_s, drive_v), steps_s)
    moved = ringing.with_effects(MechanicalResonance(90.0, 0.05), joint).simulate(steps_s, drive_v)
    assert np.allclose(moved, bent, atol=1e-12) == bool(behind_masses), "behind them what rings is bent"


def test_a_contact_that_does_not_cling_is_near_to_a_joint_behind_the_masses() -> None:
    kink = LostPreload(**IntermittentContact(contact_um=0.5, stiffness_share=0.2).kin()["lost_preload"])
    assert (kink.kink_um, kink.slope_change, kink.behind_masses) == (0.4, 0.25, 1.0)


def test_a_mass_and_an_amplifier_that_ring_alike_are_near_to_each_other() -> None:
    assert MechanicalResonance(90.0, 0.05).kin() == {"drive_resonance": {"frequency_hz": 90.0, "damping_ratio": 0.05}}
    assert DriveResonance(90.0, 0.05).kin() == {"mechanical_resonance": {"frequency_hz": 90.0, "damping_ratio": 0.05}}
