// The charts of a report: drawn with uPlot when they come into view, with one time axis for all.
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const root = document.documentElement;
  const length = data.duration > 0 ? data.duration : 1;
  const whole = [data.begin, data.begin + length];
  const shortest = Math.max(length / 1e5, 1e-3);
  const view = { low: whole[0], high: whole[1] };
  const isWhole = () => view.low <= whole[0] && view.high >= whole[1];
  const plots = new Map(); // by the element of the chart
  const visible = new Set();
  const find = (selector) => document.querySelector(selector);

  const floats = (text) => new Float32Array(bytes(text));
  const bytes = (text) => Uint8Array.from(atob(text), (each) => each.charCodeAt(0)).buffer;
  const times = (text) => Array.from(new Uint32Array(bytes(text)), (each) => data.begin + (each / 0xffffffff) * data.duration);
  const numbers = (text) => Array.from(floats(text), (each) => (Number.isFinite(each) ? each : null));
  const colours = new Map(); // of the present scheme
  const colour = (name) => {
    if (!colours.has(name)) colours.set(name, getComputedStyle(root).getPropertyValue(name).trim());
    return colours.get(name);
  };

  function clock(seconds, digits) {
    if (length < 120) return seconds.toFixed(digits) + " s";
    const sign = seconds < 0 ? "-" : "";
    const rounded = Number(Math.abs(seconds).toFixed(digits));
    const minutes = Math.floor(rounded / 60);
    const rest = (rounded - 60 * minutes).toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
    const hours = Math.floor(minutes / 60);
    return sign + (hours ? hours + ":" + String(minutes % 60).padStart(2, "0") : minutes) + ":" + rest;
  }

  // one time axis

  function show(low, high) {
    const shown = Math.min(Math.max(high - low, shortest), length);
    const begin = Math.min(Math.max(low, whole[0]), whole[1] - shown);
    if (begin === view.low && begin + shown === view.high) return;
    view.low = begin;
    view.high = begin + shown;
    apply();
  }

  function apply() {
    root.style.setProperty("--low", view.low - whole[0]);
    root.style.setProperty("--scale", 100 / (view.high - view.low));
    for (const element of visible) fit(plots.get(element));
    drawInterval();
    const digits = view.high - view.low < 10 ? 2 : view.high - view.low < 600 ? 1 : 0;
    find("#shown-time").textContent = isWhole()
      ? "Whole log, " + clock(length, 1)
      : clock(view.low, digits) + " to " + clock(view.high, digits);
  }

  function fit(plot) {
    if (plot && !plot.own && (plot.scales.x.min !== view.low || plot.scales.x.max !== view.high)) {
      plot.setScale("x", { min: view.low, max: view.high });
    }
  }

  const zoom = (factor, middle) => {
    const place = middle === undefined ? (view.low + view.high) / 2 : middle;
    show(place - (place - view.low) * factor, place + (view.high - place) * factor);
  };
  const pan = (share) => {
    const step = (view.high - view.low) * share;
    show(view.low + step, view.low + step + (view.high - view.low));
  };

  // behind and above lines

  function drawBehind(plot) {
    const { ctx, bbox } = plot;
    const rectangle = (begin, end, style, alpha, top, height) => {
      const left = Math.max(plot.valToPos(begin, "x", true), bbox.left);
      const right = Math.min(plot.valToPos(end, "x", true), bbox.left + bbox.width);
      if (right <= left) return;
      ctx.globalAlpha = alpha;
      ctx.fillStyle = style;
      ctx.fillRect(left, top, right - left, height);
    };
    ctx.save();
    const height = bbox.height / data.flights.length; // each flight has a band of its own
    data.flights.forEach(({ modes, failsafes }, place) => {
      const top = bbox.top + place * height;
      for (const [, number, begin, end] of modes) rectangle(begin, end, colour("--mode-" + number), 0.16, top, height);
      for (const [begin, end] of failsafes) {
        rectangle(begin, end, colour("--bad"), 0.22, top, height);
        rectangle(begin, end, colour("--bad"), 1, top, 4 * devicePixelRatio);
      }
    });
    ctx.restore();
  }

  function drawMarks(plot) {
    const { ctx, bbox } = plot;
    const areFew = data.marks.length <= 12;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const [time, isCalm] of data.marks) {
      const left = plot.valToPos(time, "x", true);
      if ((isCalm && !areFew) || left < bbox.left || left > bbox.left + bbox.width) continue;
      ctx.strokeStyle = colour(isCalm ? "--faint" : "--bad");
      ctx.beginPath();
      ctx.moveTo(left, bbox.top);
      ctx.lineTo(left, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  function drawFrequencies(marks) {
    return (plot) => {
      const { ctx, bbox } = plot;
      const place = (value) => Math.round(plot.valToPos(value, "x", true));
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.font = 11 * devicePixelRatio + "px system-ui, sans-serif";
      ctx.textAlign = "right";
      for (const [label, low, high] of marks) {
        ctx.strokeStyle = ctx.fillStyle = colour(low < high ? "--bad" : "--faint");
        ctx.globalAlpha = 0.12;
        ctx.fillRect(place(low), bbox.top, place(high) - place(low), bbox.height);
        ctx.globalAlpha = 1;
        ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
        ctx.beginPath();
        ctx.moveTo(place(low), bbox.top);
        ctx.lineTo(place(low), bbox.top + bbox.height);
        ctx.stroke();
        ctx.translate(place(low) - 3 * devicePixelRatio, bbox.top + 2);
        ctx.rotate(-Math.PI / 2);
        ctx.fillText(label, 0, 0);
        ctx.setTransform(1, 0, 0, 1, 0, 0);
      }
      ctx.restore();
    };
  }

  // charts

  const heightOf = (width) => (width < 500 ? 190 : 220);

  function make(element) {
    const chart = data.charts[Number(element.dataset.chart)];
    const own = chart.axis; // of a chart that is not over time
    const places = own ? (text) => Array.from(floats(text)) : times;
    const tables = chart.tables.map(([when, values]) => [places(when), ...values.map(numbers)]);
    const atPlace = (value) => shortened(value) + (own.unit ? " " + own.unit : "");
    const ink = () => colour("--faint");
    const grid = { stroke: () => colour("--line"), width: 1 };
    const step = uPlot.paths.stepped({ align: 1 });
    const axis = { stroke: ink, grid, ticks: grid, font: "12px system-ui, sans-serif" };
    const plot = new uPlot(
      {
        width: element.clientWidth,
        height: heightOf(element.clientWidth),
        scales: { x: { time: false, min: own ? own.low : view.low, max: own ? own.high : view.high }, y: { range: (self, low, high) => around(low, high) } },
        axes: [
          { ...axis, space: 70, size: 34, values: (self, splits) => splits.map(own ? atPlace : (each) => clock(each, digitsOf(splits))) },
          { ...axis, size: 58, values: (self, splits) => splits.map(shortened) },
        ],
        series: [
          { label: "Time", value: (self, value) => (value === null ? "" : own ? atPlace(value) : clock(value, 2)) },
          ...chart.lines.map((line) => ({
            label: line.label,
            stroke: () => colour("--line-" + line.colour),
            width: 1.4,
            dash: line.dash ? [5, 4] : undefined,
            paths: line.step ? step : undefined,
            points: { size: 4 },
            value: (self, value, number, at) => valueAt(self, number, at, chart.unit),
          })),
        ],
        cursor: { drag: { x: true, y: false, setScale: Boolean(own) }, points: { size: 6 } },
        legend: { live: true },
        hooks: own
          ? { draw: [drawFrequencies(own.marks)] }
          : { drawClear: [drawBehind], draw: [drawMarks], setSelect: [select], setCursor: [follow] },
      },
      uPlot.join(tables),
      element
    );
    plot.own = own;
    plots.set(element, plot);
    if (own) return;
    plot.over.addEventListener("dblclick", () => show(...whole));
    plot.over.addEventListener("wheel", (event) => wheel(plot, event), { passive: false });
    touch(plot);
  }

  function around(low, high) {
    if (low === null) return [0, 1];
    const least = Math.max(Math.abs(low), Math.abs(high)) * 1e-3 || 1;
    return high - low < least ? [(low + high) / 2 - least, (low + high) / 2 + least] : uPlot.rangeNum(low, high, 0.1, false);
  }

  const digitsOf = (splits) => {
    const between = splits.length > 1 ? splits[1] - splits[0] : 1;
    return between < 0.01 ? 3 : between < 0.1 ? 2 : between < 1 ? 1 : 0;
  };
  const shortened = (value) => {
    if (value === null) return "";
    return Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-3) ? value.toExponential(0) : String(Number(value.toPrecision(6)));
  };

  function valueAt(plot, number, index, unit) {
    // lines of a chart have times of their own: show the latest value
    const values = plot.data[number];
    if (index === null) return "";
    for (let at = index; at >= 0 && at > index - 2000; at--) {
      if (values[at] !== undefined) {
        return values[at] === null ? "-" : Number(values[at].toPrecision(5)) + (unit ? " " + unit : "");
      }
    }
    return "-";
  }

  function select(plot) {
    const { left, width } = plot.select;
    if (width > 3) {
      plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      show(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
    }
  }

  let isFollowing = false;
  function follow(plot) {
    if (isFollowing) return;
    isFollowing = true;
    const left = plot.cursor.left;
    const time = left >= 0 ? plot.posToVal(left, "x") : null;
    for (const element of visible) {
      const other = plots.get(element);
      if (other && other !== plot && !other.own) {
        other.setCursor(time === null ? { left: -10, top: -10 } : { left: other.valToPos(time, "x"), top: -10 });
      }
    }
    isFollowing = false;
    point(time);
  }

  function wheel(plot, event) {
    if (!event.ctrlKey && !event.shiftKey) return; // the page scrolls
    event.preventDefault();
    const delta = event.deltaY || event.deltaX;
    if (event.shiftKey) pan(Math.sign(delta) * 0.1);
    else zoom(Math.exp(Math.max(Math.min(delta, 100), -100) / 300), plot.posToVal(event.offsetX, "x"));
  }

  function touch(plot) {
    // one finger to the side moves the time, two fingers zoom; up and down scrolls the page
    let held = null;
    const at = (event) => {
      const box = plot.over.getBoundingClientRect();
      return [...event.touches].map((each) => each.clientX - box.left);
    };
    const start = (event) => {
      held = event.touches.length ? { places: at(event), low: view.low, high: view.high } : null;
    };
    const move = (event) => {
      if (!held || held.places.length !== event.touches.length) return start(event);
      const places = at(event);
      const width = plot.over.clientWidth;
      const perPixel = (held.high - held.low) / width;
      if (places.length === 2) {
        event.preventDefault();
        const before = Math.max(Math.abs(held.places[1] - held.places[0]), 10);
        const factor = before / Math.max(Math.abs(places[1] - places[0]), 10);
        const middle = held.low + ((held.places[0] + held.places[1]) / 2) * perPixel;
        const low = middle - ((places[0] + places[1]) / 2) * perPixel * factor;
        show(low, low + (held.high - held.low) * factor);
      } else if (view.high - view.low < length) {
        const moved = (held.places[0] - places[0]) * perPixel;
        show(held.low + moved, held.high + moved);
      } else {
        plot.setCursor({ left: places[0], top: 10 });
      }
    };
    plot.over.addEventListener("touchstart", start, { passive: true });
    plot.over.addEventListener("touchmove", move, { passive: false });
    plot.over.addEventListener("touchend", start, { passive: true });
  }

  // the track, and what is at the cursor

  const tracks = data.flights.filter((each) => each.track).map(({ name, track, modes }) => ({
    times: times(track[0]), east: floats(track[1]), north: floats(track[2]), up: track[3] && floats(track[3]), modes,
    number: name === "B" ? 1 : 0,
  }));
  const index = (track, time) => {
    let low = 0;
    let high = track.times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (track.times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  };
  const place = (track, at) => track.east[at] + " " + -track.north[at];

  function intervalOf(track) {
    const first = Math.max(index(track, view.low), 0);
    const last = index(track, view.high);
    const points = [];
    for (let at = first; at <= last; at++) points.push(place(track, at));
    return points.length ? "M" + points.join("L") : "";
  }

  function drawInterval() {
    const path = find("#track-interval");
    if (!path) return;
    drawSpace();
    path.setAttribute("d", isWhole() ? "" : tracks.map(intervalOf).join(""));
    find("#track").classList.toggle("is-part", !isWhole());
  }

  function dotOf(track, time) {
    const at = time === null ? -1 : index(track, time);
    return at < 0 ? "" : "M" + place(track, at) + "h0";
  }

  function point(time) {
    const dot = find("#track-dot");
    if (dot) dot.setAttribute("d", tracks.map((track) => dotOf(track, time)).join(""));
    space.time = time;
    drawSpace();
    find("#at-cursor").textContent = time === null ? "" : factsAt(time).filter(Boolean).join(" · ");
  }

  const modeAt = (modes, time) => modes.find((each) => each[2] <= time && time < each[3]);

  function factsAt(time) {
    const near = (view.high - view.low) / 100;
    const mark = data.marks.find((each) => Math.abs(each[0] - time) < near);
    const modes = data.flights.map(({ name, modes }) => {
      const mode = modeAt(modes, time);
      return mode ? (name && name + ": ") + mode[0] : "";
    });
    return [clock(time, 2), ...modes, mark ? mark[2] : ""];
  }

  // the track in three dimensions: turned by dragging

  const space = { turn: 0.6, tilt: 0.5, time: null };
  const canvas = find("#space");
  const bounds = [Infinity, -Infinity, Infinity, -Infinity, 0, 0]; // of east, north and up
  for (const { east, north, up } of tracks) {
    [east, north, up || []].forEach((values, axis) => {
      for (const each of values) {
        if (each < bounds[2 * axis]) bounds[2 * axis] = each;
        if (each > bounds[2 * axis + 1]) bounds[2 * axis + 1] = each;
      }
    });
  }

  function stretchesOf({ times, modes, number }) {
    // colours, and the places at which they begin and end: those of the flight modes, or of a flight of two
    const found = [];
    const add = (colour, begin, end) => end > begin && found.push([colour, begin, Math.min(end, times.length - 1)]);
    if (data.flights.length > 1) return [[number, 0, times.length - 1]];
    let place = 0;
    for (const [, colour, begin, end] of modes) {
      const [first, next] = [index({ times }, begin) + 1, index({ times }, end) + 1];
      add(8, place, first);
      add(colour, Math.max(first, place), next);
      place = Math.max(next, place);
    }
    add(8, place, times.length);
    return found;
  }

  function drawSpace() {
    if (!canvas || canvas.hidden) return;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    const ctx = canvas.getContext("2d");
    ctx.scale(devicePixelRatio, devicePixelRatio);
    const [middleEast, middleNorth, middleUp] = [0, 2, 4].map((at) => (bounds[at] + bounds[at + 1]) / 2);
    const size = Math.max(Math.hypot(bounds[1] - bounds[0], bounds[3] - bounds[2]), bounds[5] - bounds[4], 2);
    const scale = (0.85 * Math.min(width, height * 1.4)) / size;
    const [sine, cosine, lift, flat] = [Math.sin(space.turn), Math.cos(space.turn), Math.cos(space.tilt), Math.sin(space.tilt)];
    const at = (east, north, up) => {
      const right = (east - middleEast) * cosine - (north - middleNorth) * sine;
      const away = (east - middleEast) * sine + (north - middleNorth) * cosine;
      return [width / 2 + scale * right, height / 2 - scale * (away * flat + (up - middleUp) * lift)];
    };
    const line = (style, wide, alpha, points) => {
      ctx.strokeStyle = style;
      ctx.lineWidth = wide;
      ctx.globalAlpha = alpha;
      ctx.beginPath();
      points.forEach((point, number) => (number ? ctx.lineTo(...point) : ctx.moveTo(...point)));
      ctx.stroke();
    };
    const dot = (style, radius, [left, top], isRing) => {
      ctx.globalAlpha = 1;
      ctx.beginPath();
      ctx.arc(left, top, radius, 0, 7);
      ctx.lineWidth = 4;
      ctx.fillStyle = ctx.strokeStyle = style;
      if (isRing) ctx.stroke();
      else ctx.fill();
    };
    const step = 10 ** Math.floor(Math.log10(size / 2)); // of the grid on the ground
    for (let way = -10; way <= 10; way++) {
      const [east, north] = [step * (Math.round(middleEast / step) + way), step * (Math.round(middleNorth / step) + way)];
      if (Math.abs(east - middleEast) <= size / 2) line(colour("--line"), 1, 1, [at(east, middleNorth - size / 2, 0), at(east, middleNorth + size / 2, 0)]);
      if (Math.abs(north - middleNorth) <= size / 2) line(colour("--line"), 1, 1, [at(middleEast - size / 2, north, 0), at(middleEast + size / 2, north, 0)]);
    }
    for (const track of tracks) {
      const up = (place) => (track.up && Number.isFinite(track.up[place]) ? track.up[place] : 0);
      const point = (place) => at(track.east[place], track.north[place], up(place));
      const ground = (place) => at(track.east[place], track.north[place], 0);
      const last = track.times.length - 1;
      const places = [...track.times.keys()];
      line(colour("--faint"), 1, 0.5, places.map(ground));
      for (let each = 0; each <= 40; each++) {
        const place = Math.round((each / 40) * last);
        line(colour("--faint"), 1, 0.4, [ground(place), point(place)]);
      }
      track.stretches = track.stretches || stretchesOf(track);
      for (const [number, begin, end] of track.stretches) {
        line(colour("--mode-" + number), 2.5, 1, places.slice(begin, end + 1).map(point));
      }
      dot("#2aa860", 8, point(0), true);
      dot(colour("--bad"), 5, point(last));
      const now = space.time === null ? -1 : index(track, space.time);
      if (now >= 0) dot(colour("--text"), 6, point(now));
    }
    ctx.globalAlpha = 1;
    ctx.fillStyle = colour("--faint");
    ctx.font = "12px system-ui, sans-serif";
    ctx.fillText("grid " + step + " m; drag to turn", 10, height - 10);
    ctx.fillText("N", ...at(middleEast, middleNorth + size / 2, 0));
  }

  if (canvas && tracks.some((each) => each.up)) {
    const button = find("#view");
    button.hidden = false;
    button.addEventListener("click", () => {
      canvas.hidden = !canvas.hidden;
      find("#track").style.display = canvas.hidden ? "" : "none";
      button.textContent = canvas.hidden ? "In 3D" : "From above";
      drawSpace();
    });
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      space.turn -= event.movementX / 150;
      space.tilt = Math.min(Math.max(space.tilt + event.movementY / 150, 0), Math.PI / 2);
      drawSpace();
    });
  }

  // the page

  const elements = [...document.querySelectorAll("[data-chart]")];
  const draw = (element) => (plots.has(element) ? fit(plots.get(element)) : make(element));
  const observer = new IntersectionObserver(
    (entries) => {
      for (const { target, isIntersecting } of entries) {
        if (isIntersecting) {
          visible.add(target);
          draw(target);
        } else visible.delete(target);
      }
    },
    { rootMargin: "400px 0px" }
  );
  elements.forEach((each) => observer.observe(each));

  function resize(width) {
    for (const [element, plot] of plots) {
      const wide = width || element.clientWidth;
      if (wide && wide !== plot.width) plot.setSize({ width: wide, height: heightOf(wide) });
    }
  }
  addEventListener("resize", () => (resize(), drawSpace()));
  addEventListener("beforeprint", () => {
    elements.forEach(draw);
    resize(340); // two columns on a page
  });
  addEventListener("afterprint", () => resize());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours.clear();
    for (const [element, plot] of [...plots]) {
      plot.destroy();
      plots.delete(element);
      if (visible.has(element)) make(element);
    }
  });
  const actions = { in: () => zoom(0.5), out: () => zoom(2), earlier: () => pan(-0.25), later: () => pan(0.25), all: () => show(...whole) };
  document.querySelectorAll("[data-action]").forEach((button) => {
    button.addEventListener("click", () => actions[button.dataset.action]());
  });
  document.querySelectorAll("[data-time]").forEach((button) => {
    button.addEventListener("click", () => {
      const wide = Math.min(Math.max(length / 20, 2), length);
      const time = Number(button.dataset.time);
      show(time - wide / 2, time + wide / 2);
      find("#charts").scrollIntoView({ block: "start" });
    });
  });
  window.flightReport = { view, plots, show };
  root.style.setProperty("--whole", length);
  find("#controls").hidden = false;
  apply();
})();
