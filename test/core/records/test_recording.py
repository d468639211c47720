"""Recording: checked once, copied, read-only."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.errors import RecordingError
from fomrc_core.records.recording import Recording


def _recording(n_samples: int = 11, **columns: object) -> Recording:
    time_s = np.arange(n_samples) * 0.1
    return Recording(time_s, np.sin(time_s), np.cos(time_s), **columns)  # type: ignore[arg-type]


def test_arrays_are_copied_and_read_only() -> None:
    time_s, voltage_v = np.arange(3.0), np.ones(3)
    recording = Recording(time_s, voltage_v)
    voltage_v[0] = 7.0
    assert recording.voltage_v[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        recording.voltage_v[0] = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.voltage_v = voltage_v  # type: ignore[misc]


def test_lists_and_integers_become_float64() -> None:
    recording = Recording([0, 1, 2], [3, 4, 5])  # type: ignore[arg-type]
    assert recording.voltage_v.dtype == np.float64
    assert recording.n_samples == 3


@pytest.mark.parametrize(
    ("time_s", "voltage_v", "expected"),
    [
        ([0.0, 1.0], [1.0, 2.0, 3.0], "voltage_v has another length than time_s"),
        ([0.0], [1.0], "too few samples"),
        ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "time_s does not increase at sample 2"),
        ([0.0, 2.0, 1.0], [1.0, 2.0, 3.0], "time_s does not increase at sample 2"),
        ([0.0, 1.0], [1.0, np.nan], "voltage_v is not finite at sample 1"),
        ([0.0, np.inf], [1.0, 1.0], "time_s is not finite at sample 1"),
        ([0.0, 1.0], ["a", "b"], "voltage_v is not numeric"),
        ([0.0, 1.0], [[1.0], [2.0]], "voltage_v is not one-dimensional"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(time_s: list, voltage_v: list, expected: str) -> None:
    with pytest.raises(RecordingError, match=expected) as caught:
        Recording(time_s, voltage_v, name="stage.csv")  # type: ignore[arg-type]
    assert str(caught.value).startswith("stage.csv: ")
    assert "\n" not in str(caught.value)


def test_every_optional_column_is_checked() -> None:
    for column in [field.name for field in dataclasses.fields(Recording)][2:-1]:
        with pytest.raises(RecordingError, match=column):
            Recording([0.0, 1.0], [0.0, 1.0], **{column: [0.0]})  # type: ignore[arg-type]


def test_steps_sum_to_the_duration_after_the_first() -> None:
    time_s = np.cumsum([0.0, 0.1, 0.1, 0.3, 0.1])
    recording = Recording(time_s, np.zeros(5))
    np.testing.assert_array_equal(recording.steps_s[1:], np.diff(time_s))
    assert recording.steps_s[0] == recording.sample_period_s == pytest.approx(0.1)
    assert recording.duration_s == pytest.approx(0.6)


@given(st.integers(3, 400), st.floats(1e-5, 10.0), st.floats(-1e3, 1e3))
def test_time_that_is_uniform_but_for_rounding_gives_equal_steps(n: int, period_s: float, start_s: float) -> None:
    recording = Recording(start_s + np.arange(n) * period_s, np.zeros(n))
    steps_s = recording.steps_s
    np.testing.assert_allclose(steps_s, period_s, rtol=1e-6, atol=1e-12 * abs(start_s))


def test_window_keeps_every_column_and_its_name() -> None:
    cut = _recording(temperature_c=np.arange(11.0), name="warm").window(0.2, 0.5)
    assert cut.name == "warm"
    np.testing.assert_allclose(cut.time_s, [0.2, 0.3, 0.4])
    assert cut.temperature_c is not None
    np.testing.assert_array_equal(cut.temperature_c, [2.0, 3.0, 4.0])


def test_a_window_outside_the_record_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"window holds fewer than 2 samples.*within 0\.\.1 s"):
        _recording().window(5.0, 6.0)


def test_measured_displacement_is_asked_for_by_name() -> None:
    with pytest.raises(RecordingError, match="a column displacement_um"):
        _ = Recording([0.0, 1.0], [0.0, 1.0]).measured_um  # type: ignore[arg-type]
    np.testing.assert_array_equal(_recording().measured_um, np.cos(_recording().time_s))


def test_tables_of_pandas_and_xarray_are_recordings_and_back() -> None:
    time_s = np.arange(11) * 0.1
    recording = Recording(time_s, np.sin(time_s), np.arange(11.0))
    frame = recording.to_dataframe()
    assert list(frame.columns) == ["time_s", "voltage_v", "displacement_um"]
    by_time = frame.set_index("time_s")
    for table in (frame, by_time, dict(frame), by_time.to_xarray()):
        back = Recording.from_table(table, name="table")
        assert back.name == "table"
        for field in frame.columns:
            np.testing.assert_array_equal(getattr(back, field), getattr(recording, field))
    series = Recording(frame["time_s"], frame["voltage_v"], by_time.to_xarray()["displacement_um"])
    np.testing.assert_array_equal(series.measured_um, recording.measured_um)
    with pytest.raises(RecordingError, match="run: no column voltage_v, got 'time_s, drive'"):
        Recording.from_table(pandas.DataFrame({"time_s": [0.0, 1.0], "drive": [0.0, 1.0]}), name="run")
