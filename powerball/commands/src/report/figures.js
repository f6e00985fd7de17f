// Makes a chart that can be zoomed of each figure that brings its samples. What it draws and how it is served:
// drag: zoom; double click or Escape: all; arrows: move; + and -: zoom; a click on a name, or Enter: hide or show it.
"use strict";
(() => {
  const NOT_A_NUMBER = -32768;
  const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

  // Times and values of one series.
  function decoded(series, timesBefore) {
    const times = series.x === null ? timesBefore : new Float32Array(bytes(series.x));
    const codes = new Int16Array(bytes(series.y));
    const value = (code) => (code === NOT_A_NUMBER ? null : series.middle + series.step * code);
    return [times, Array.from(codes, value)];
  }

  // All series of a panel over one axis of rising times, as uPlot takes them.
  function aligned(panel) {
    let times = null;
    const tables = panel.series.map((series) => {
      const table = decoded(series, times);
      times = table[0];
      return table;
    });
    if (panel.series.slice(1).every((series) => series.x === null)) {
      return [tables[0][0], ...tables.map((table) => table[1])];
    }
    // Samples at the same place are moved apart by less than can be seen: uPlot joins by place.
    for (const table of tables) {
      const x = Float64Array.from(table[0]);
      const least = 1e-9 * (x[x.length - 1] - x[0] || 1);
      for (let k = 1; k < x.length; k++) if (x[k] <= x[k - 1]) x[k] = x[k - 1] + least;
      table[0] = x;
    }
    return uPlot.join(tables);
  }

  const digits = (value) => (value == null ? "–" : String(Number(value.toPrecision(4))).replace("-", "\u2212"));

  function drawn(series) {
    const points = series.mark === "points";
    return {
      label: series.name || "\u00a0",
      stroke: () => ink(series.ink),
      width: series.mark === "broad" ? 4 : 1.3,
      alpha: series.mark === "broad" || points ? 0.6 : 1,
      dash: series.mark === "dashed" ? [5, 4] : undefined,
      paths: points ? () => null : undefined,
      points: { show: points, size: 4, width: 0, fill: () => ink(series.ink) },
      value: (_, value) => digits(value),
    };
  }

  function charts(figure, data) {
    const place = document.createElement("div");
    place.className = "plot";
    place.tabIndex = 0;
    place.setAttribute("role", "group");
    const help = "arrow keys move, plus and minus zoom, Escape shows all; drag to zoom, double click for all";
    place.setAttribute("aria-label", `${data.title}: ${help}`);
    place.title = help;
    if (data.title) {
      const title = document.createElement("div");
      title.className = "plot-title";
      title.textContent = data.title;
      place.append(title);
    }
    figure.querySelector("svg").after(place);
    // From here on the figure is a chart: before, the place has no width.
    figure.classList.add("live");
    const axis = () => ({
      stroke: () => ink("soft"),
      grid: { stroke: () => ink("line"), width: 1 },
      ticks: { stroke: () => ink("line"), width: 1 },
      // uPlot's own labels end after three decimals.
      values: (_, splits) => splits.map(digits),
    });
    const sync = uPlot.sync("figure" + charts.count++);
    const all = [];
    let moving = false;
    // All panels of a figure show the same stretch.
    const follow = (chart, key) => {
      if (key !== "x" || moving) return;
      moving = true;
      const { min, max } = chart.scales.x;
      for (const other of all) if (other !== chart) other.setScale("x", { min, max });
      moving = false;
    };
    data.panels.forEach((panel, k) => {
      const last = k + 1 === data.panels.length;
      const chart = new uPlot(
        {
          width: place.clientWidth,
          height: Math.round(panel.height) + (last ? 60 : 25),
          scales: { x: { time: false } },
          cursor: { sync: { key: sync.key, setSeries: false }, drag: { x: true, y: false } },
          axes: [
            { ...axis(), label: last ? data.x : undefined, size: last ? 34 : 25, labelSize: 22 },
            { ...axis(), label: panel.label, size: 58, labelSize: 20, space: 24 },
          ],
          series: [{ label: data.x, value: (_, value) => digits(value) }, ...panel.series.map(drawn)],
          hooks: { setScale: [follow] },
        },
        aligned(panel),
        place,
      );
      sync.sub(chart);
      all.push(chart);
      for (const entry of chart.root.querySelectorAll(".u-series th")) {
        entry.tabIndex = 0;
        entry.setAttribute("role", "button");
        entry.addEventListener("keydown", (event) => {
          if (event.key !== "Enter" && event.key !== " ") return;
          event.preventDefault();
          event.stopPropagation();
          entry.click();
        });
      }
    });
    place.addEventListener("keydown", (event) => {
      const chart = all[0];
      const x = chart.data[0];
      const [low, high] = [x[0], x[x.length - 1]];
      const { min, max } = chart.scales.x;
      const [middle, half] = [(min + max) / 2, (max - min) / 2];
      const to = {
        ArrowLeft: [min - half / 2, max - half / 2],
        ArrowRight: [min + half / 2, max + half / 2],
        "+": [middle - half / 2, middle + half / 2],
        "=": [middle - half / 2, middle + half / 2],
        "-": [middle - 2 * half, middle + 2 * half],
        Escape: [low, high],
      }[event.key];
      if (!to) return;
      event.preventDefault();
      const span = Math.min(to[1] - to[0], high - low);
      const start = Math.min(Math.max(to[0], low), high - span);
      chart.setScale("x", { min: start, max: start + span });
    });
    new ResizeObserver(() => {
      for (const chart of all) chart.setSize({ width: place.clientWidth, height: chart.height });
    }).observe(place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const chart of all) chart.redraw();
    });
    place.charts = all;
  }
  charts.count = 0;

  // A figure is drawn when it comes near: a page of many is there at once.
  const near = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        near.unobserve(target);
        charts(target, JSON.parse(target.querySelector("script").textContent));
      }
    },
    { rootMargin: "600px" },
  );
  for (const figure of document.querySelectorAll("figure")) {
    if (figure.querySelector("script")) near.observe(figure);
  }
})();
