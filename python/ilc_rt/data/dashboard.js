// Charts of the dashboard: draws options of ECharts in the colours of the theme that is shown, and appends
// live points. Loaded by every page; `window.ilc` has queued the calls that came before.
import { echarts } from "/echarts/index.js";

const charts = new Map(); // name -> {element, chart, option, live}
const queued = window.ilc.queue;
const ROW_PX = 15, NARROW_PX = 480;

function colour(name) {
  return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
}

function coloured(value) {
  if (typeof value === "string") return value[0] === "$" ? colour(value.slice(1)) : value;
  if (Array.isArray(value)) {
    // Points need no look: only a list of objects or texts can hold colours.
    return value.length && typeof value[0] === "object" && !Array.isArray(value[0]) ? value.map(coloured) : value;
  }
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, coloured(inner)]));
}

function equalScales(entry, option) {
  // One unit of length is as long in both directions, and the path is in the middle.
  let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
  for (const series of option.series) {
    for (const point of series.data) {
      for (const k of [0, 1]) {
        if (point[k] === null) continue;
        low[k] = Math.min(low[k], point[k]);
        high[k] = Math.max(high[k], point[k]);
      }
    }
  }
  if (!isFinite(low[0])) return;
  const grid = option.grid;
  const size = [
    Math.max(40, entry.element.clientWidth - grid.left - grid.right),
    Math.max(40, entry.element.clientHeight - grid.top - grid.bottom),
  ];
  const perPixel = 1.06 * Math.max((high[0] - low[0]) / size[0], (high[1] - low[1]) / size[1]) || 1;
  [option.xAxis, option.yAxis].forEach((axis, k) => {
    const middle = (low[k] + high[k]) / 2;
    axis.min = middle - (perPixel * size[k]) / 2;
    axis.max = middle + (perPixel * size[k]) / 2;
    axis.axisLabel.showMinLabel = axis.axisLabel.showMaxLabel = false;
    axis.axisLabel.formatter = (value) => String(+value.toFixed(3));
  });
}

const pen = document.createElement("canvas").getContext("2d");

function namesInRows(entry, option) {
  // A narrow chart has all its names above it, in rows, in place of a few with arrows.
  const width = entry.element.clientWidth;
  entry.element.style.removeProperty("--names");
  if (width > NARROW_PX || !option.legend || !option.series.length) return;
  const { itemWidth, textStyle, left } = option.legend;
  pen.font = `${textStyle.fontSize}px sans-serif`;
  // With the gaps of ECharts: 5 before a name, 10 behind it.
  const sizes = option.series.map((series) => itemWidth + 5 + pen.measureText(series.name).width + 10);
  if (left + sizes.reduce((sum, size) => sum + size, 0) <= width) return;
  let rows = 1, at = 0;
  for (const size of sizes) {
    if (at > 0 && at + size > width - 8) {
      rows += 1;
      at = 0;
    }
    at += size;
  }
  Object.assign(option.legend, { type: "plain", left: 0, right: 0 });
  // The name of the axis stays below the names of the lines.
  option.grid.top += ROW_PX * rows;
  entry.element.style.setProperty("--names", `${ROW_PX * rows}px`);
}

function paint(entry) {
  if (!entry.chart || !entry.option) return;
  const option = coloured(entry.option);
  delete option.ilc;
  namesInRows(entry, option);
  if (entry.option.ilc?.equal) equalScales(entry, option);
  const zoom = entry.chart.getOption()?.dataZoom?.[0];
  if (zoom && option.dataZoom) Object.assign(option.dataZoom[0], { start: zoom.start, end: zoom.end });
  entry.chart.setOption(option, { notMerge: true });
  if (entry.live) paintLive(entry);
}

function entryOf(name) {
  let entry = charts.get(name);
  const element = document.querySelector(`[data-chart="${CSS.escape(name)}"]`);
  if (!element) return null;
  if (!entry || entry.element !== element) {
    entry?.chart?.dispose();
    entry = { element, chart: echarts.init(element, null, { renderer: "canvas" }) };
    charts.set(name, entry);
    entry.width = element.clientWidth;
    new ResizeObserver(() => {
      entry.chart.resize();
      const width = element.clientWidth;
      if (entry.option?.ilc?.equal || (width !== entry.width && Math.min(width, entry.width) <= NARROW_PX)) paint(entry);
      entry.width = width;
    }).observe(element);
  }
  return entry;
}

function draw(name, option, attempts = 100) {
  const entry = entryOf(name);
  if (!entry) {
    // The element comes with the next rendering of the page.
    if (attempts > 0) setTimeout(() => draw(name, option, attempts - 1), 20);
    return;
  }
  entry.option = option;
  if (option.ilc?.group) {
    entry.chart.group = option.ilc.group;
    echarts.connect(option.ilc.group);
  }
  paint(entry);
}

// ---- live charts

let pushes = 0;
let waiting = false;
const dirty = new Set();
let ring = null; // {epoch, seconds, length, first, low: [row], high: [row]}

function live(message) {
  if (!ring || ring.epoch !== message.epoch) {
    ring = { epoch: message.epoch, length: message.length, first: message.first, low: [], high: [] };
  }
  ring.seconds = message.seconds;
  const skip = ring.first + ring.low.length - message.first;
  if (skip < 0) {
    ring.first = message.first;
    ring.low = [];
    ring.high = [];
  }
  ring.low.push(...message.low.slice(Math.max(0, skip)));
  ring.high.push(...message.high.slice(Math.max(0, skip)));
  const excess = ring.low.length - ring.length;
  if (excess > 0) {
    ring.low.splice(0, excess);
    ring.high.splice(0, excess);
    ring.first += excess;
  }
  // Painting waits for the browser: what is out of sight is painted about once a second.
  pushes += 1;
  for (const [name, part] of Object.entries(message.charts)) {
    const entry = entryOf(name);
    if (!entry || !entry.option) continue;
    entry.live = part;
    const box = entry.element.getBoundingClientRect();
    if (pushes % 20 === 1 || (box.bottom > 0 && box.top < window.innerHeight)) dirty.add(entry);
  }
  if (dirty.size && !waiting) {
    waiting = true;
    requestAnimationFrame(paintDirty);
  }
}

function paintDirty() {
  waiting = false;
  for (const entry of dirty) paintLive(entry);
  dirty.clear();
}

function shown() {
  // For the server, which sends more after it: what is in sight has been painted.
  if (waiting && !document.hidden) return new Promise((done) => requestAnimationFrame(() => done()));
}

function paintLive(entry) {
  if (!ring) return;
  const { from, scales, units } = entry.live;
  const n = ring.low.length;
  const series = scales.map((scale, axis) => {
    const data = new Array(2 * n);
    for (let k = 0; k < n; k += 1) {
      const time = (k - n + 0.5) * ring.seconds;
      const low = ring.low[k][from + axis];
      const high = ring.high[k][from + axis];
      data[2 * k] = [time, low === null ? null : low * scale];
      data[2 * k + 1] = [time, high === null ? null : high * scale];
    }
    return { data };
  });
  const yAxis = [...new Set(units)].slice(0, 2).map((unit) => ({ name: unit }));
  entry.chart.setOption({ title: { show: false }, series, yAxis, xAxis: { min: -ring.length * ring.seconds, max: 0, axisLabel: { showMinLabel: false } } }, { lazyUpdate: true });
}

// ---- theme, and loss of the connection

function themed() {
  for (const entry of charts.values()) paint(entry);
}

const CHOICES = { auto: "as the system", light: "light", dark: "dark" };

function theme(choice) {
  const now = localStorage.getItem("ilc-theme") ?? "auto";
  const names = Object.keys(CHOICES);
  const next = choice ?? names[(names.indexOf(now) + 1) % names.length];
  localStorage.setItem("ilc-theme", next);
  window.Quasar.Dark.set(next === "auto" ? "auto" : next === "dark");
  const button = document.querySelector("[data-theme-switch]");
  if (button) {
    button.textContent = `Theme: ${next}`;
    button.setAttribute("aria-label", `Colours: ${CHOICES[next]}; switch`);
  }
}

function ready() {
  if (!window.Quasar || !document.querySelector("[data-theme-switch]")) {
    setTimeout(ready, 20);
    return;
  }
  theme(localStorage.getItem("ilc-theme") ?? "auto");
  new MutationObserver(themed).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  const popup = document.getElementById("popup");
  popup?.setAttribute("role", "alert");
}

Object.assign(window.ilc, {
  draw,
  live,
  shown,
  theme,
  // For tests: what is drawn.
  option: (name) => charts.get(name)?.chart.getOption(),
  pushes: () => pushes,
});
for (const [method, ...values] of queued.splice(0)) window.ilc[method](...values);
ready();
