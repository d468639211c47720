"""What every test run needs: the same examples each time; tests that compute wait for those that talk over ROS."""

from __future__ import annotations

import contextlib
import os
import random
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

_ROS_TESTS = "test/ros/"
_MANY = 1000  # tests of a whole run: whoever asks for some gets all cases of them
# Minutes in all: every experiment of the paper, the models of others, the steps of a truth's physics, a second seed,
# the spread of errors over many draws, a hundred periods (benchmarks.fast_scans prints those), what repeats with
# another signal or colour, what a study counts over many cases, pages whose diagnosis others make as well.
_LONGEST = (
    "test/core/cli/test_axes_commands.py::test_stopped_it_goes_on_where_it_was[2]",
    "test/core/reproduction/test_reproduction.py",
    "test/core/comparison/test_comparison.py",
    "test/core/comparison/test_baselines.py",
    "test/core/effects/test_creep_of_elements.py::test_relays_that_settle_the_more_the_wider_they_are_are_told",
    "test/core/diagnosis/test_long_search.py::test_a_load_in_a_long_record",
    "test/core/diagnosis/test_long_search.py::test_coloured_noise_in_a_long_record_is_no_cause",
    "test/core/diagnosis/test_held_between_samples.py::test_each_sample_is_held_whatever_the_rate_of_a_record",
    "test/core/diagnosis/test_past_beside_drift.py::test_of_a_past_and_a_drift_the_noise_is_left[12--2.5-0.5]",
    "test/core/diagnosis/test_held_between_samples.py::test_beside_a_delay_that_took_its_time_another_rate_tells_it",
    "test/core/diagnosis/test_remainder.py::test_noise_of_any_colour_follows_from_nothing[0.6]",
    "test/core/diagnosis/test_remainder.py::test_noise_of_any_colour_follows_from_nothing[0.95]",
    "test/core/identification/test_axes_identification.py::test_two_axes_of_another_form_are_found[1]",
    "test/core/identification/test_axes_identification.py::test_errors_over_standard_errors_spread_by_one",
    "test/core/records/test_noise_model.py::test_p_values_of_white_noise_are_even",
    "test/core/records/test_slips.py::test_a_record_that_is_late_as_a_whole_has_no_doubled_samples",
    "test/core/report/test_recording_check.py::test_loops_of_many_widths_rests_and_a_repeat_are_better",
    "test/core/model/test_dynamic_inverse.py::test_an_endless_scan_stays_as_it_was_in_its_second_period",
    "test/hidden/second/test_second_case.py::test_form_error_says",
    "test/hidden/second/test_second_case.py::test_steps_of_the_physics",
    "test/hidden/test_hidden_effects.py::test_hidden_cause_is_named_first[2013-dead_zone]",
    "test/hidden/test_hidden_effects.py::test_hidden_cause_is_named_first[2014-missing_hysteresis]",
    "test/hidden/test_hidden_effects.py::test_what_stands_in_for_a_cause",
    "test/hidden/test_one_sine.py",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[creep_law-122033-new]",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[intermittent_contact-142069-new]",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[intermittent_contact-272013-new]",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[intermittent_contact-92069-new]",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[sensor_bandwidth-92015-new]",
    "test/hidden/test_told_wrong_before.py::test_it_is_named_explained_and_measured[voltage_dependent_capacitance",
    "test/hidden/test_told_wrong_before.py::test_what_stood_in_for_another_is_asked_again_beside_all",
    "test/test_documentation.py::test_examples_run[diagnose]",
    "test/test_documentation.py::test_the_cells_of_a_notebook_run[3_what_does_my_model_get_wrong]",
    "test/ros/test_axes.py::test_what_axes_of_one_body_move_of_each_other",
    "test/ros/test_calibration.py::test_joint_states_and_simulated_time_faster",
    "test/ros/test_never_garbage.py::test_a_cancel_that_comes_too_late",
    "test/ros/test_never_garbage.py::test_row_01_a_calibration_on_a_broken_sensor_is_refused[outliers]",
)
# Of the cases of one test here the first and the last run, of others all.
_ALIKE = (
    _ROS_TESTS,
    "test/core/diagnosis/test_untaught.py",
    "test/core/export/test_exported_effects.py::test_all_effects_together",
    "test/core/export/test_exported_effects.py::test_an_effect_alone",
    "test/core/model/test_model.py::test_plain_python_equals_compiled",
    "test/core/records/test_noise_model.py",
    "test/core/records/test_noisy_drive.py",
    "test/hidden/test_truth.py",
)
# Last of those of ROS, when no other nodes are started: it learns how a stage is that nothing holds up.
_LEARNS = "test/ros/test_watch_node.py"
# Files of a minute or two and of many waits, begun first of their kind so that no worker is left alone with one.
_LONG_FILES = (
    "test/hidden/test_hidden_effects.py",
    "test/core/diagnosis/",
    "test/core/effects/test_foreign_effects.py",
    "test/core/export/",
    "test/core/identification/test_fleet.py",
    "test/core/records/test_noise_model.py",
    "test/core/records/test_noisy_drive.py",
    "test/ros/test_never_garbage.py",
    "test/ros/test_calibration.py",
    "test/ros/test_files_and_parameters.py",
    "test/ros/test_fuzz_in_service.py",
    "test/ros/test_voltage_limits.py",
    "test/ros/test_axes.py",
    "test/ros/test_parameters.py",
    "test/ros/test_identification.py",
)
# Each test of these takes long by itself; elsewhere what a file's tests look at is made once, in one worker.
_ONE_BY_ONE = ("test/hidden/test_hidden_effects.py", "test/hidden/test_one_sine.py", "test/hidden/second/")

# A test run draws the same examples every time; "make study" draws new ones, with
# --hypothesis-profile new_examples, and prints how to draw a failing one again. How long one takes says how busy the
# machine is.
settings.register_profile("same_examples", derandomize=True, database=None, deadline=None)
settings.register_profile("new_examples", print_blob=True, deadline=None)
settings.load_profile("same_examples")

# Set before any ROS context exists: a domain for each worker, so that ROS tests may run beside each other, the first of
# them at random unless the caller has chosen it.
_FIRST_DOMAIN = int(os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100))))
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
if _WORKER:
    os.environ["ROS_DOMAIN_ID"] = str((_FIRST_DOMAIN + _WORKER) % 102)
# Over the loopback and not by shared memory. A node that is killed, as the tests kill many, leaves its ports of shared
# memory behind; whoever meets them afterwards and then closes its own ends with a segmentation fault in libfastdds 3.2,
# SharedMemChannelResource::release() locking a mutex in memory that is gone. A discovery range of LOCALHOST brings
# shared memory back whatever FASTDDS_BUILTIN_TRANSPORTS says, so the profile says both.
if os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp") == "rmw_fastrtps_cpp":
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(Path(__file__).parent / "ros" / "loopback.xml"))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
else:
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def _of_many_alike(items: list[pytest.Item]) -> tuple[list[pytest.Item], list[pytest.Item]]:
    """Return what runs and what is left to ``make study``: the longest, and of many alike all but the ends."""
    if os.environ.get("FOMRC_ALL_CASES"):
        return items, []
    alike: dict[str, list[pytest.Item]] = {}
    for item in items:
        alike.setdefault(item.nodeid.split("[")[0], []).append(item)
    left = [i for name, same in alike.items() if name.startswith(_ALIKE) for i in same[1:-1]]
    left += [item for item in items if item.nodeid.startswith(_LONGEST)]
    return [item for item in items if item not in left], left


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the long files first of their kind."""
    if len(items) > _MANY:
        items[:], left = _of_many_alike(items)
        config.hook.pytest_deselected(items=left)
    items.sort(key=lambda item: _place(item.nodeid))


def _place(nodeid: str) -> tuple[bool, bool, int]:
    rank = next((k for k, name in enumerate(_LONG_FILES) if nodeid.startswith(name)), len(_LONG_FILES))
    return nodeid.startswith(_ROS_TESTS), nodeid.startswith(_LEARNS), rank


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Let whatever computes wait for the nodes of the tests beside it, which mostly wait themselves, at 1 kHz."""
    is_worker = "PYTEST_XDIST_WORKER" in os.environ
    if is_worker and not item.nodeid.startswith(_ROS_TESTS) and os.sched_getscheduler(0) != os.SCHED_IDLE:
        _wait_for_all_others()


def _wait_for_all_others() -> None:
    # A priority counts among the processes of one session alone where the kernel groups them by session, as it does by
    # default: the group has one of its own. Without that nodes, each in its session, stood still for 0.1 s and more.
    with contextlib.suppress(OSError):
        os.setsid()
        Path("/proc/self/autogroup").write_text("19")
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Spread tests over the workers file by file, the longest one by one; ROS tests over half of them.

    A worker that has computed is last in line and remains so: it is given no ROS test. Nodes of tests that run at the
    same time are in domains of their own.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return nodeid if nodeid.startswith(_ONE_BY_ONE) else nodeid.split("::")[0]

        def _next_scope(self, node: Any) -> str | None:
            is_ros, others = [], []
            for scope in self.workqueue:
                (is_ros if scope.startswith(_ROS_TESTS) else others).append(scope)
            mine = is_ros or others if node in self._of_ros else others
            return mine[0] if mine else None

        @cached_property
        def _of_ros(self) -> list[Any]:
            return self.nodes[: max(1, len(self.nodes) // 2)]

        def _assign_work_unit(self, node: Any) -> None:
            scope = self._next_scope(node)
            if scope is None:
                node.shutdown()
                return
            self.workqueue.move_to_end(scope, last=False)
            super()._assign_work_unit(node)

    # The scheduler would begin with the largest group.
    config.option.loadscopereorder = False
    return ByFile(config, log)
