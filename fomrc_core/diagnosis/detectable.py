"""Which causes recordings would have shown, and from which size on: the screening of a diagnosis without its search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fomrc_core.compute.blas_threads import with_one_algebra_thread
from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.findings import smallest_detectable
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.recording import Recording


@with_one_algebra_thread
def detectable(recordings: Sequence[Recording], noise_um: float) -> Mapping[str, Mapping[str, float]]:
    """Return for each cause the size of its main parameter that these recordings would just have revealed.

    Causes that nothing in the records brings out are missing.

    Args:
        recordings: of one stage.
        noise_um: noise floor [um].
    """
    split = split_data(tuple(recordings), None, None, noise_um)
    base = base_model(split)
    names = tuple(name for name, kind in cause_classes().items() if kind.is_named and not kind.adds_elements)
    return smallest_detectable(screen(PresentModel.of(base, split), names, held_view(base, split), None), split)
