"use strict";
// Draws the plots, in the dress of the surroundings, and ties a cursor on the path to the curves.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 600px)");
  const drawn = new Set();
  const config = {
    responsive: true,
    displaylogo: false,
    showSendToCloud: false, // nothing leaves the page
    scrollZoom: false,
    modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d", "resetCameraLastSave3d"],
    toImageButtonOptions: { format: "svg", filename: "peakflight" },
  };

  /** A value with the names of colours, such as "@ink", replaced by what they are now. */
  const themed = (value, colours) => {
    if (typeof value === "string") return value[0] === "@" ? colours[value.slice(1)] : value;
    if (Array.isArray(value)) {
      return typeof value[0] === "number" ? value : value.map((one) => themed(one, colours));
    }
    if (value !== null && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, themed(v, colours)]));
    }
    return value;
  };

  const draw = (name) => {
    const colours = data.themes[dark.matches ? "dark" : "light"];
    const plot = themed(data.plots[name], colours);
    const layout = {
      ...plot.layout,
      autosize: true,
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: colours.soft, activecolor: colours.ink },
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colours.ink },
    };
    if (narrow.matches) {
      if (layout.scene) {
        const { eye } = layout.scene.camera; // a narrow plot shows less across
        layout.scene.camera.eye = { x: 1.6 * eye.x, y: 1.6 * eye.y, z: 1.6 * eye.z };
        plot.data.find((trace) => trace.name === "legs").visible = "legendonly";
      }
      layout.margin = { ...layout.margin, l: Math.min(layout.margin.l, 40), r: 4 };
      for (const trace of plot.data) {
        const bar = (trace.marker || trace.line || {}).colorbar;
        if (bar) Object.assign(bar, { thickness: 8, len: 0.5 });
      }
    }
    drawn.add(name);
    return window.Plotly.react(name, plot.data, layout, config);
  };

  const hasSpace = (() => {
    try {
      const canvas = document.createElement("canvas");
      return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
    } catch {
      return false;
    }
  })();

  const views = ["path", "above"];
  const buttons = [...document.querySelectorAll("[data-view]")];
  const show = (view) => {
    for (const name of views) document.getElementById(name).hidden = name !== view;
    for (const button of buttons) {
      button.setAttribute("aria-pressed", String(button.dataset.view === view));
    }
    if (drawn.has(view)) return window.Plotly.Plots.resize(view);
    return draw(view);
  };
  for (const button of buttons) {
    button.addEventListener("click", () => show(button.dataset.view));
    if (button.dataset.view === "path" && !hasSpace) {
      button.disabled = true;
      button.title = "This browser has no WebGL";
    }
  }

  /** The index of the sample of the path that is nearest to a time. */
  const rows = data.plots.path.data[0].customdata;
  const nearest = (time) => {
    let low = 0;
    let high = rows.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (rows[middle][0] <= time) low = middle;
      else high = middle;
    }
    return time - rows[low][0] <= rows[high][0] - time ? low : high;
  };

  let waiting = null;
  const point = (time) => {
    const asked = waiting !== null;
    waiting = time;
    if (!asked) requestAnimationFrame(place);
  };
  const place = () => {
    const index = nearest(waiting);
    waiting = null;
    for (const name of views) {
      const element = document.getElementById(name);
      if (!drawn.has(name) || element.hidden) continue;
      const path = data.plots[name].data[0];
      const last = data.plots[name].data.length - 1;
      const change = { x: [[path.x[index]]], y: [[path.y[index]]], visible: true };
      if (path.z) change.z = [[path.z[index]]];
      window.Plotly.restyle(name, change, [last]);
    }
  };

  const start = async () => {
    await show(hasSpace ? "path" : "above");
    for (const name of Object.keys(data.plots)) {
      if (views.includes(name)) continue;
      await draw(name);
      if (name === "legs-plot") continue;
      document.getElementById(name).on("plotly_hover", (event) => {
        const time = event.xvals ? event.xvals[0] : event.points[0].x;
        point(time);
      });
    }
    document.documentElement.dataset.ready = "true";
  };
  const again = () => [...drawn].forEach(draw);
  dark.addEventListener("change", again);
  narrow.addEventListener("change", again);
  start();
})();
