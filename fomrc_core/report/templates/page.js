"use strict";
// The figure of the page: which record is shown, colours by day, night and on paper, and the spectrum of what is marked.
(() => {
  const data = document.getElementById("linked-figure");
  if (!data) return;
  const config = JSON.parse(data.textContent);
  const paper = window.matchMedia("print");
  const night = window.matchMedia("(prefers-color-scheme: dark)");

  function drawn() {
    return window.Bokeh && Bokeh.documents.find((doc) => doc.get_model_by_name("samples"));
  }

  function everyModel(doc) {
    const seen = new Set();
    for (const root of doc.roots()) for (const model of root.references()) seen.add(model);
    return seen;
  }

  function colour(doc) {
    const dark = night.matches && !paper.matches && !colour.onPaper;
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue(name).trim();
    const [text, line] = dark ? [of("--text"), of("--line")] : ["#222222", "#d5dade"];
    for (const model of everyModel(doc)) {
      const name = model.type;
      if (name === "Figure") {
        model.outline_line_color = line;
      } else if (/Axis$/.test(name)) {
        for (const part of ["axis_label_text_color", "major_label_text_color", "axis_line_color",
                            "major_tick_line_color", "minor_tick_line_color"]) model[part] = text;
      } else if (name === "Grid") {
        model.grid_line_color = line;
      } else if (name === "GlyphRenderer" && config.palette[model.name]) {
        const shade = config.palette[model.name][dark ? 1 : 0];
        for (const glyph of [model.glyph, model.selection_glyph, model.nonselection_glyph]) {
          if (!glyph || typeof glyph === "string") continue;
          if ("fill_color" in glyph) glyph.fill_color = shade;
          else if ("line_color" in glyph) glyph.line_color = shade;
        }
      }
    }
  }

  // Mean power of the stretches that hold a marked sample, or of all where none is marked.
  function spectrum(doc) {
    const source = doc.get_model_by_name("samples");
    const target = doc.get_model_by_name("spectrum");
    const shown = doc.get_model_by_name("shown").indices;
    if (!shown.length) return;
    const among = new Set(shown);
    const marked = source.selected.indices.filter((k) => among.has(k));
    const places = marked.length ? marked : shown;
    const record = source.data.record[places[0]];
    const found = config.spectra[record];
    const stretches = new Set();
    for (const k of places) if (source.data.record[k] === record) stretches.add(source.data.stretch[k]);
    const columns = {frequency: found.frequency};
    for (const name of target ? Object.keys(target.data) : []) {
      if (name === "frequency") continue;
      const powers = [...stretches].map((k) => found.power[name][k]).filter((p) => p);
      columns[name] = found.frequency.map((_, i) =>
        Math.sqrt(Math.max(powers.reduce((sum, p) => sum + p[i], 0) / Math.max(powers.length, 1), 2.3e-308)));
    }
    if (target) target.data = columns;
    const said = document.getElementById("marked");
    const several = config.records.length > 1 ? `spectrum of ${config.records[record]}` : "";
    const count = marked.length ? `${marked.length} of ${shown.length} samples marked` : "";
    said.textContent = [count, several].filter((part) => part).join("; ");
  }

  function start(doc) {
    const source = doc.get_model_by_name("samples");
    const shown = doc.get_model_by_name("shown");
    const again = () => spectrum(doc);
    source.selected.properties.indices.change.connect(again);
    const choice = document.getElementById("record");
    if (choice) choice.addEventListener("change", () => {
      source.selected.indices = [];
      const all = [...source.data.record.keys()];
      shown.indices = choice.value === "all" ? all : all.filter((k) => source.data.record[k] === Number(choice.value));
      again();
    });
    document.getElementById("reset").addEventListener("click", () => {
      source.selected.indices = [];
      for (const plot of doc.roots()) plot.reset.emit();
    });
    for (const medium of [night, paper]) medium.addEventListener("change", () => colour(doc));
    window.addEventListener("beforeprint", () => { colour.onPaper = true; colour(doc); });
    window.addEventListener("afterprint", () => { colour.onPaper = false; colour(doc); });
    colour(doc);
    again();
    document.documentElement.dataset.figure = "ready";
  }

  let n = 0;
  (function wait() {
    const doc = drawn();
    if (doc) start(doc);
    else if (n++ < 400) setTimeout(wait, 25);
  })();
})();
