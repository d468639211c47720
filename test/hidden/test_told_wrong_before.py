"""Cases of the second world that were told wrong once, each with why.

Of seeds that had been reported: what they show was mended, and they report nothing any more.
"""

from __future__ import annotations

import pytest

from fomrc_core.diagnosis.diagnosis import diagnose
from test.hidden.study_recording import recording_of
from test.hidden.study_second import SecondSpec
from test.hidden.study_second_parameters import second_parameter_error


def _parameter_error_of(cause: str, seed: int, group: str) -> float | None:
    """Return the relative error of the main parameter of the one cause that is found, and explains.

    None where truth and product have no parameter in common, as of an opened lead.
    """
    case = SecondSpec(group, seed, (cause,)).draw()
    train, test, report = (recording_of(record) for record in case.records)
    found = diagnose(train, test=test, report=report)
    assert [finding.cause for finding in found.findings] == [cause], str(found)
    assert found.status.value == "explained", str(found)
    (finding,) = found.findings
    return second_parameter_error(cause, case.parameters[cause], dict(finding.parameters), case)


@pytest.mark.parametrize(
    ("cause", "seed", "group"),
    [
        # forms of one sensor were compared with plays that had been chosen before it: told as an amplifier
        ("sensor_bandwidth", 92015, "new"),
        # a logarithm in the place of the power law begins far off and was given up: told as six parameters and a drift
        ("creep_law", 92019, "new"),
        # a hum known from one record was not looked for where another's drive has its line
        ("mains_hum", 91088, "known"),
        # the times of an opening were moved where nobody looks, to make up for what is elsewhere
        ("intermittent_contact", 92069, "new"),
        # of four relaxations the fourth had been told as a slow_relaxation beside the law
        ("creep_law", 122033, "new"),
        # the grid of its plays was too coarse for the noise: one-sided plays were told beside it
        ("voltage_dependent_capacitance", 142008, "new"),
        # an opening on a plateau of one record was missed, and what that left was no noise
        ("intermittent_contact", 142069, "new"),
        # an opening of the third record was moved into the next valley of its drive
        ("intermittent_contact", 272013, "new"),
        # its plays were the base's, those of the sensor it was compared with had been chosen anew: told with 4 %
        ("zero_order_hold", 402018, "new"),
    ],
)
def test_it_is_named_explained_and_measured(cause: str, seed: int, group: str) -> None:
    error = _parameter_error_of(cause, seed, group)
    assert (error is None) == (cause in ("creep_law", "intermittent_contact"))
    assert error is None or error < 0.1


def test_a_walk_of_the_sensor_is_no_drift() -> None:
    # what a drift leaves of a walk wanders less: beside that the walk itself looked impossible
    train, test, report = (recording_of(r) for r in SecondSpec("null", 280010, noise="walk").draw().records)
    found = diagnose(train, test=test, report=report)
    assert found.status.value == "nothing_found", str(found)


def test_an_opening_is_named_beside_turns_where_something_jumps() -> None:
    # turns of the drive passed for levels where noise wanders, and of eight openings two were any
    case = SecondSpec("new", 292013, ("intermittent_contact",)).draw()
    train, test, report = (recording_of(r) for r in case.records)
    found = diagnose(train, test=test, report=report)
    assert [finding.cause for finding in found.findings] == ["intermittent_contact"], str(found)


@pytest.mark.parametrize(
    ("causes", "seed", "group"),
    [
        # much was left beside an amplifier, which nobody asked again since it had been sure: a sensor leaves the noise
        (("initial_state", "sensor_bandwidth", "slow_relaxation"), 225008, "triples"),
        # a sensor of two stages stood in for both; held out the amplifier did better, in training only with the hold
        (("amplifier_bandwidth", "zero_order_hold"), 234000, "pairs"),
    ],
)
def test_what_stood_in_for_another_is_asked_again_beside_all(causes: tuple[str, ...], seed: int, group: str) -> None:
    case = SecondSpec(group, seed, causes).draw()
    train, test, report = (recording_of(record) for record in case.records)
    found = diagnose(train, test=test, report=report)
    assert {finding.cause for finding in found.findings} == set(causes), str(found)
    assert found.status.value == "explained", str(found)
