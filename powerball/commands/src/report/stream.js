// A page that is fed while an arm moves: objects over server-sent events. One of kind "start" says what there is to see
// ({title, fields: {name: unit}}), "sample" has t and a list by joint for each field, "event" a text, "end" a text.
"use strict";
(() => {
  const style = getComputedStyle(document.documentElement);
  const inks = ["c1", "c2", "c4", "c5", "c6", "c7", "c3"].map((name) => style.getPropertyValue("--" + name).trim());
  const place = document.getElementById("charts");
  const state = document.getElementById("state");
  const events = document.getElementById("events");
  const MOST = 20000; // samples that are kept
  const FRAME = 100; // ms between two drawings
  let charts = [];
  let times = [];
  let dirty = false;

  const label = (name) => name.replace(/_/g, " ");
  const clear = () => {
    charts.forEach((chart) => chart.plot && chart.plot.destroy());
    place.textContent = "";
    [charts, times] = [[], []];
  };
  const start = (message) => {
    clear();
    document.getElementById("title").textContent = message.title;
    for (const [name, unit] of Object.entries(message.fields)) {
      const figure = document.createElement("figure");
      figure.id = "field-" + name;
      const caption = document.createElement("figcaption");
      caption.textContent = `${label(name)} [${unit}]`;
      figure.append(caption);
      place.append(figure);
      charts.push({ name, figure, lists: null, plot: null });
    }
  };
  const plot = (chart) => {
    const series = chart.lists.map((_, j) => ({ label: "joint " + (j + 1), stroke: inks[j % inks.length], width: 1.5 }));
    const axis = { stroke: style.getPropertyValue("--soft").trim(), grid: { stroke: style.getPropertyValue("--line").trim() } };
    const options = {
      width: Math.max(280, chart.figure.clientWidth),
      height: 180,
      scales: { x: { time: false } },
      series: [{ label: "t [s]" }, ...series],
      axes: [axis, { ...axis, size: 60 }],
      cursor: { drag: { x: true, y: false } },
    };
    return new uPlot(options, [times, ...chart.lists], chart.figure);
  };
  const sample = (message) => {
    // A second run of the same path begins anew.
    if (times.length && message.t < times[times.length - 1]) {
      times.length = 0;
      charts.forEach((chart) => chart.lists && chart.lists.forEach((list) => (list.length = 0)));
    }
    times.push(message.t);
    for (const chart of charts) {
      const values = message[chart.name] || [];
      chart.lists = chart.lists || values.map(() => []);
      chart.lists.forEach((list, j) => list.push(values[j] ?? null));
    }
    if (times.length > MOST) {
      times.splice(0, MOST / 10);
      charts.forEach((chart) => chart.lists.forEach((list) => list.splice(0, MOST / 10)));
    }
    state.textContent = `${message.run ? message.run + ", " : ""}${message.t.toFixed(1)} s`;
    dirty = true;
  };
  const draw = () => {
    if (dirty) {
      dirty = false;
      for (const chart of charts) {
        if (!chart.lists) continue;
        chart.plot = chart.plot || plot(chart);
        chart.plot.setData([times, ...chart.lists]);
      }
    }
  };
  const say = (text, tone) => {
    const line = document.createElement("p");
    line.className = "note " + tone;
    line.textContent = text;
    events.prepend(line);
  };
  const source = new EventSource("events" + location.search);
  source.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.kind === "start") start(message);
    else if (message.kind === "sample") sample(message);
    else if (message.kind === "event") say(message.text, "bad");
    else if (message.kind === "end") {
      say(message.text, "");
      source.close();
    }
  };
  // Who comes back gets all again: nothing may be there twice.
  source.onopen = () => {
    clear();
    events.textContent = "";
  };
  source.onerror = () => (state.textContent = "no connection");
  setInterval(draw, FRAME);
})();
