"""The comparison treats every model alike and writes what it found."""

import json
import math

import numpy as np
import pytest

from fomrc_core.comparison.baselines.cascade_rival import CascadeRival
from fomrc_core.comparison.baselines.goldfarb_celanovic import GoldfarbCelanovic
from fomrc_core.comparison.baselines.mrc import MaxwellResistiveCapacitor
from fomrc_core.comparison.baselines.prandtl_ishlinskii import PrandtlIshlinskii
from fomrc_core.comparison.baselines.rival import Rival
from fomrc_core.comparison.comparison import compare
from fomrc_core.errors import ParameterError
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.records.recording import Recording

RATE_HZ = 100.0


def record(amplitude_v, name, seed):
    t = np.arange(1500) / RATE_HZ
    voltage = amplitude_v * np.sin(2 * np.pi * 0.3 * t) * np.exp(-t / 8.0)
    x = table1_plant(20, substep_s=5e-3).simulate(1 / RATE_HZ, voltage)
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, x.size)
    return Recording(t, voltage, x + noise + 5.0, name=name)


class Unfittable(Rival):
    name = "unfittable"
    publication = "none"

    def fit(self, records):
        raise ParameterError("does not fit", where="here")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    directory = tmp_path_factory.mktemp("comparison")
    shares = []
    comparison = compare(
        record(2.5, "train", 1),
        record(2.0, "test", 2),
        directory,
        lambda share, text: shares.append((share, text)),
        rivals=[CascadeRival(PrandtlIshlinskii()), MaxwellResistiveCapacitor(), GoldfarbCelanovic(), Unfittable()],
        with_amplifier=False,
        settle_s=0.0,
        skip_s=0.1,
    )
    return comparison, directory, shares


def test_creep_wins_where_there_is_creep(found):
    rows = {row.name: row for row in found[0].rows}
    assert found[0].rows[0].name == "FOMRC"
    assert rows["FOMRC"].test_rms_um < 0.5 * rows["MRC without creep"].test_rms_um
    assert rows["FOMRC"].inverse is not None
    assert rows["FOMRC"].inverse.is_stable
    assert rows["Goldfarb-Celanovic electromechanical"].inverse is None


def test_a_rival_that_cannot_be_fitted_is_last_with_its_reason(found):
    last = found[0].rows[-1]
    assert last.name == "unfittable"
    assert last.failure == "here: does not fit"
    assert math.isnan(last.test_rms_um)


def test_files_say_what_the_comparison_says(found):
    comparison, directory, shares = found
    data = json.loads((directory / "comparison.json").read_text())
    assert [row["name"] for row in data["rows"]] == [row.name for row in comparison.rows]
    assert data["rows"][-1]["test_rms_um"] is None
    assert data["rows"][0]["test_rms_um"] == comparison.rows[0].test_rms_um
    assert (directory / "comparison.md").read_text().count("\n") == len(comparison.rows) + 2
    assert (directory / "comparison.png").stat().st_size > 10_000
    assert "<svg" in (directory / "comparison.svg").read_text()
    assert shares[-1][0] == 1.0
    assert [share for share, _ in shares] == sorted(share for share, _ in shares)


def test_nrmse_is_of_the_measured_range(found):
    comparison = found[0]
    row = comparison.rows[0]
    assert row.test_nrmse_percent == pytest.approx(100 * row.test_rms_um / comparison.test_range_um, rel=1e-12)


def test_a_comparison_cut_short_goes_on_where_it_stopped(tmp_path):
    class Stopped(Rival):
        name = "stopped"
        publication = "none"

        def fit(self, records):
            raise KeyboardInterrupt

    class Counted(MaxwellResistiveCapacitor):
        n_fitted = 0

        def fit(self, records):
            Counted.n_fitted += 1
            return super().fit(records)

    def run(test, rivals):
        train = record(2.5, "train", 1)
        return compare(train, test, tmp_path, rivals=rivals, with_amplifier=False, settle_s=0.0)

    held_out = record(2.0, "test", 2)
    with pytest.raises(KeyboardInterrupt):
        run(held_out, [Unfittable(), Counted(), Stopped()])
    found = run(held_out, [Unfittable(), Counted()])
    assert Counted.n_fitted == 1
    again = run(held_out, [Unfittable(), Counted()])
    assert again.table() == found.table()
    assert Counted.n_fitted == 1
    run(record(1.9, "another", 2), [Counted()])
    assert Counted.n_fitted == 2
