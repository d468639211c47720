"""Pages as a browser shows them: nothing complained of, nothing loaded, all drawn, nothing cut, accessible."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import PROGRAM, Chromium
from test_report import _FINDING, _MODEL, _diagnosis

from fomrc_core.report.diagnosis_files import write_report
from fomrc_core.report.provenance import Provenance
from fomrc_core.report.view_pages import comparison_page

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no Chromium")

# Panels whose canvases hold more than one colour, of all panels; figures live in shadow trees.
_DRAWN = """(() => {
  const all = (r) => [...r.querySelectorAll('*')].flatMap((e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])]);
  const panels = [...document.querySelectorAll('.plot')];
  const is_drawn = (p) => all(p).filter((e) => e.tagName === 'CANVAS' && e.width > 100).some((c) => {
    const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});
    const pen = copy.getContext('2d', {willReadFrequently: true});
    pen.drawImage(c, 0, 0);
    const data = new Uint32Array(pen.getImageData(0, 0, c.width, c.height).data.buffer);
    return new Set(data).size > 20;
  });
  return [panels.filter(is_drawn).length, panels.length,
    [...document.images].filter((i) => i.naturalWidth > 100).length, document.images.length];
})()"""
_MARKED = "Bokeh.documents[0].get_model_by_name('samples').selected.indices.length"
_SPECTRUM = "Bokeh.documents[0].get_model_by_name('spectrum').data.before[0]"
_FAULTS = "axe.run(document).then(r => r.violations.map(v => [v.impact, v.id, v.nodes.map(n => n.html.slice(0, 120))]))"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    with Chromium(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    (folder / "rec.csv").write_text("time_s\n")
    provenance = Provenance.of(("fomrc", "diagnose", "rec.csv"), [("recording", folder / "rec.csv")])
    write_report(_diagnosis(findings=(_FINDING,)), folder, provenance)
    return folder / "report.html"


def check_page(browser: Chromium, page: Path, scheme: str) -> None:
    """Hold the open page to what every page owes its reader."""
    assert page.stat().st_size < 3e6
    assert browser.complaints == []
    assert [r for r in browser.requests if not r.startswith(("data:", page.resolve().as_uri()))] == []
    n_drawn, n_panels, n_shown, n_images = browser.run(_DRAWN)
    assert (n_drawn, n_shown) == (n_panels, n_images)
    assert n_panels >= 6
    assert browser.run("document.documentElement.scrollWidth <= window.innerWidth")
    assert browser.run("[...document.images].every((i) => i.alt.length > 10)")
    ground = browser.run("getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") is (scheme == "light")


def faults(browser: Chromium) -> list[Any]:
    """Return what axe-core finds wrong in the open page that is serious or critical."""
    axe = pytest.importorskip("axe_core_python")
    browser.run(Path(axe.__path__[0], "axe.min.js").read_text("utf-8") + ";1")
    return [fault for fault in browser.run(_FAULTS) if fault[0] in ("serious", "critical")]


@pytest.mark.parametrize("dresses", [((390, "dark"), (400, "light"), (400, "dark")), ((1400, "light"), (1400, "dark"))])
def test_a_report_is_whole_on_telephones_and_screens(
    browser: Chromium, report: Path, dresses: tuple[tuple[int, str], ...]
) -> None:
    browser.open(report, *dresses[0])
    assert faults(browser) == []
    for width, scheme in dresses:
        # the page follows a window that is resized and a system that turns dark
        browser.dress(width, scheme)
        check_page(browser, report, scheme)


def test_a_comparison_is_whole_on_a_telephone_and_on_paper(browser: Chromium, tmp_path: Path) -> None:
    page = tmp_path / "view.html"
    page.write_text(comparison_page({"a.yaml": _MODEL, "b.yaml": _MODEL.with_effects()}), encoding="utf-8")
    browser.open(page, 390, "dark")
    check_page(browser, page, "dark")
    browser.dress(800, "dark", "print")
    assert browser.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert browser.run("[...document.querySelectorAll('button')].every((b) => getComputedStyle(b).display === 'none')")
    assert browser.run("Bokeh.documents[0].roots()[0].left[0].axis_label_text_color") == "#222222"


def test_what_is_marked_in_one_panel_is_marked_in_all_and_makes_the_spectrum(browser: Chromium, report: Path) -> None:
    browser.open(report, 1400, "light")
    before = browser.run(_SPECTRUM)
    browser.run("document.querySelector('.plot').scrollIntoView({block: 'center'})")
    x, y, width, height = browser.run(
        "(({x, y, width, height}) => [x, y, width, height])(document.querySelector('.plot').getBoundingClientRect())"
    )
    # the last quarter of the time, in which the drive rests and nothing is wrong
    browser.drag((x + 0.84 * width, y + 0.15 * height), (x + 0.98 * width, y + 0.8 * height))
    browser.run("new Promise(r => setTimeout(r, 300))")
    n_marked = browser.run(_MARKED)
    assert 200 < n_marked < 1200
    assert browser.run(_SPECTRUM) < 0.1 * before
    assert browser.run("document.getElementById('marked').textContent").startswith(f"{n_marked} of 4000 samples marked")
    browser.run("document.getElementById('reset').click()")
    assert browser.run(_MARKED) == 0
    assert browser.run(_SPECTRUM) == pytest.approx(before)
    shown = "Bokeh.documents[0].get_model_by_name('shown').indices.length"
    assert browser.run(shown) == 4000
    browser.run("(c => {c.value = 'all'; c.dispatchEvent(new Event('change'))})(document.getElementById('record'))")
    assert browser.run(shown) == 8000
