/* Reading, zoom and theme of a report. The page is complete without it; it fetches nothing. */
"use strict";

(function () {
  const root = document.documentElement;
  const button = document.getElementById("theme");
  const THEMES = ["system", "light", "dark"];
  let theme = "system";
  try {
    theme = localStorage.getItem("ilc-report-theme") || theme;
  } catch (error) {
    /* A page from a file may keep nothing. */
  }

  function show(name) {
    theme = THEMES.includes(name) ? name : "system";
    if (theme === "system") root.removeAttribute("data-theme");
    else root.setAttribute("data-theme", theme);
    button.textContent = "Colours: " + theme;
  }
  button.addEventListener("click", function () {
    show(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]);
    try {
      localStorage.setItem("ilc-report-theme", theme);
    } catch (error) {
      /* As above. */
    }
  });
  button.hidden = false;
  show(theme);
})();

for (const figure of document.querySelectorAll("figure[data-plot]")) {
  const { axes, series } = JSON.parse(figure.dataset.plot);
  const stage = figure.querySelector(".stage");
  const svg = stage.querySelector("svg");
  const mark = stage.querySelector(".mark");
  const readout = figure.querySelector("output");
  const [, , width, height] = svg.getAttribute("viewBox").split(/\s+/).map(Number);
  const whole = { x: 0, y: 0, w: width, h: height };
  const ZOOM_MAX = 40;
  const REACH_PX = 40;
  let view = { ...whole };
  /* Points of each line in the coordinates of the picture, as drawn. */
  const lines = series.map(function ({ id, label, axes: place }) {
    const path = document.getElementById(id).querySelector("path");
    const numbers = (path.getAttribute("d").match(/-?[\d.]+(?:e-?\d+)?/g) || []).map(Number);
    const points = [];
    for (let k = 0; k + 1 < numbers.length; k += 2) points.push([numbers[k], numbers[k + 1]]);
    return { label, axes: axes[place], points };
  });
  let chosen = { line: 0, point: -1 };

  function value(scale, position) {
    const [at0, at1, from, to, kind] = scale;
    const share = (position - at0) / (at1 - at0);
    if (kind === "log") return from * Math.pow(to / from, share);
    return from + share * (to - from);
  }

  function told(scale, position) {
    const [, , from, to, , label] = scale;
    const number = value(scale, position);
    const [name, unit] = label.split(" in ");
    const small = Math.abs(number) < Math.abs(to - from) / 2000;
    const digits = small ? "0" : String(Number(number.toPrecision(3)));
    return `${name.replace(/ \(.*/, "")} ${digits}${unit ? " " + unit : ""}`;
  }

  function place(event) {
    const box = svg.getBoundingClientRect();
    return [
      view.x + ((event.clientX - box.left) / box.width) * view.w,
      view.y + ((event.clientY - box.top) / box.height) * view.h,
    ];
  }

  function put([x, y], within, label) {
    readout.textContent =
      (label ? label + ": " : "") + told(within.x, x) + ", " + told(within.y, y);
    mark.hidden = !label;
    mark.style.left = ((x - view.x) / view.w) * 100 + "%";
    mark.style.top = ((y - view.y) / view.h) * 100 + "%";
  }

  function point(event) {
    const [x, y] = place(event);
    const within = axes.find(function ({ x: a, y: b }) {
      return x >= a[0] && x <= a[1] && y >= Math.min(b[0], b[1]) && y <= Math.max(b[0], b[1]);
    });
    if (!within) return leave();
    let nearest = (REACH_PX * view.w) / svg.getBoundingClientRect().width;
    let found = null;
    lines.forEach(function (line, number) {
      if (line.axes !== within) return;
      line.points.forEach(function (one, index) {
        const distance = Math.hypot(one[0] - x, one[1] - y);
        if (distance < nearest) [nearest, found] = [distance, { line: number, point: index }];
      });
    });
    if (!found) return put([x, y], within, "");
    chosen = found;
    put(lines[found.line].points[found.point], within, lines[found.line].label);
  }

  function leave() {
    readout.textContent = "";
    mark.hidden = true;
  }

  function look(next) {
    const w = Math.min(width, Math.max(width / ZOOM_MAX, next.w));
    const h = (w * height) / width;
    view = {
      x: Math.min(width - w, Math.max(0, next.x)),
      y: Math.min(height - h, Math.max(0, next.y)),
      w,
      h,
    };
    svg.setAttribute("viewBox", `${view.x} ${view.y} ${view.w} ${view.h}`);
    stage.classList.toggle("zoomed", view.w < width);
    mark.hidden = true;
  }

  function zoom(factor, [x, y] = [view.x + view.w / 2, view.y + view.h / 2]) {
    const w = view.w / factor;
    const bounded = Math.min(width, Math.max(width / ZOOM_MAX, w)) / view.w;
    look({ x: x - (x - view.x) * bounded, y: y - (y - view.y) * bounded, w });
  }

  /* Steps along a line, or from one to the next. */
  function step(along, across) {
    if (!lines.length) return;
    const line = (chosen.line + across + lines.length) % lines.length;
    const points = lines[line].points;
    const start = chosen.point < 0 ? (along < 0 ? points.length : -1) : chosen.point;
    chosen = { line, point: Math.min(points.length - 1, Math.max(0, start + along)) };
    put(points[chosen.point], lines[line].axes, lines[line].label);
  }

  const KEYS = {
    ArrowRight: (more) => step(more ? 10 : 1, 0),
    ArrowLeft: (more) => step(more ? -10 : -1, 0),
    ArrowDown: () => step(0, 1),
    ArrowUp: () => step(0, -1),
    "+": () => zoom(1.5),
    "=": () => zoom(1.5),
    "-": () => zoom(1 / 1.5),
    0: () => look(whole),
    Escape: () => (look(whole), leave()),
  };
  svg.addEventListener("keydown", function (event) {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(event.shiftKey);
  });

  let held = null;
  svg.addEventListener("pointerdown", function (event) {
    point(event);
    if (view.w < width) {
      held = [event.clientX, event.clientY, view];
      svg.setPointerCapture(event.pointerId);
    }
  });
  svg.addEventListener("pointermove", function (event) {
    if (!held) return point(event);
    const box = svg.getBoundingClientRect();
    const [x, y, from] = held;
    look({
      x: from.x - ((event.clientX - x) / box.width) * from.w,
      y: from.y - ((event.clientY - y) / box.height) * from.h,
      w: from.w,
    });
  });
  for (const name of ["pointerup", "pointercancel"])
    svg.addEventListener(name, () => (held = null));
  svg.addEventListener("pointerleave", () => held || leave());
  svg.addEventListener("dblclick", (event) => zoom(view.w < width / 8 ? 1 / ZOOM_MAX : 2, place(event)));
  svg.addEventListener(
    "wheel",
    function (event) {
      /* The wheel alone scrolls the page. */
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 300), place(event));
    },
    { passive: false },
  );
  const tools = figure.querySelector(".tools");
  const ACTS = { in: () => zoom(1.5), out: () => zoom(1 / 1.5), whole: () => look(whole) };
  for (const tool of tools.querySelectorAll("button"))
    tool.addEventListener("click", ACTS[tool.dataset.act]);
  tools.hidden = false;
}
