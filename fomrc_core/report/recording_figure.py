"""A recording at a glance: voltage and displacement over time, and one against the other."""

from __future__ import annotations

from matplotlib.figure import Figure

from fomrc_core.records.plausibility import summary_line
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_figures import png
from fomrc_core.report.residual_views import envelope


def recording_png(recording: Recording) -> bytes:
    """Return a small picture of a recording as a PNG."""
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    over_time, loop = figure.subplots(1, 2, width_ratios=(2.0, 1.0))
    time_s = recording.time_s
    over_time.plot(*envelope(time_s, recording.voltage_v), color="#1f6f8b", lw=0.9)
    over_time.set_ylabel("voltage [V]", color="#1f6f8b")
    over_time.set_xlabel("time [s]")
    if recording.displacement_um is not None:
        beside = over_time.twinx()
        beside.plot(*envelope(time_s, recording.displacement_um), color="#d1495b", lw=0.9)
        beside.set_ylabel("displacement [µm]", color="#d1495b")
        loop.plot(recording.voltage_v, recording.displacement_um, color="#333333", lw=0.5)
    loop.set_xlabel("voltage [V]")
    loop.set_ylabel("displacement [µm]")
    figure.suptitle(f"{recording.name}: {summary_line(recording)}", fontsize=10)
    return png(figure)
