/* Cost against score: a point a model with its interval, its name beside it. */
"use strict";

const Chart = (() => {
  const [WIDTH, HEIGHT] = [860, 420];
  const [LEFT, RIGHT, TOP, BOTTOM] = [52, 150, 34, 46];
  /** Sizes of a name: the width of a letter at the most, the height of a line. */
  const [LETTER, LINE] = [7.2, 14];
  /** How far below its point a name may stand, the nearest first. */
  const SHIFTS = [0, ...Array.from({ length: 30 }, (_, n) => [(n + 1) * 7, -(n + 1) * 7]).flat()];
  const AXES = [
    ["usd_per_100", "Cost of 100 replies [USD]"],
    ["usd_per_solved", "Cost of a solved sample [USD]"],
    ["completion_tokens", "Tokens of a reply"],
    ["latency_s", "Seconds a reply"],
  ];

  const fact = (row, track, name) => (row.facts[track.name] ? row.facts[track.name][name] : null);

  /** The axes that at least two models have a value on, most of all first. */
  function axes(board, track) {
    const known = (name) => board.rows.filter((row) => fact(row, track, name) > 0).length;
    return AXES.filter(([name]) => known(name) > 1);
  }

  function ticks(low, high) {
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const step of [1, 2, 5]) {
        const at = step * 10 ** power;
        if (at >= low && at <= high) found.push(at);
      }
    }
    const isPower = (at) => Math.abs(Math.log10(at) - Math.round(Math.log10(at))) < 1e-9;
    return found.length > 9 ? found.filter(isPower) : found;
  }

  /** The least of 1, 2 or 5 times a power of ten that is no smaller. */
  function niceStep(least) {
    const power = 10 ** Math.floor(Math.log10(least));
    return [1, 2, 5, 10].find((times) => times * power >= least * 0.9999) * power;
  }

  const said = (value) => (value >= 1000 ? value.toLocaleString("en") : String(Number(value.toPrecision(3))));

  /** The drawing, and the models that could not be drawn. */
  function draw(board, track, column, axis) {
    const [name, title] = AXES.find(([one]) => one === axis);
    const all = board.rows.filter((row) => row.values[column.id]);
    const rows = all.filter((row) => fact(row, track, name) > 0);
    const without = all.filter((row) => !rows.includes(row));
    const xs = rows.map((row) => fact(row, track, name));
    const [low, high] = [Math.min(...xs) / 1.6, Math.max(...xs) * 1.6];
    const tops = rows.map((row) => row.values[column.id][2] ?? row.values[column.id][0]);
    const step = niceStep(Math.max(...tops, 1e-9) / 5);
    const most = Math.ceil(Math.max(...tops, 1e-9) / step) * step;
    const x = (value) => LEFT + (Math.log(value / low) / Math.log(high / low)) * (WIDTH - LEFT - RIGHT);
    const y = (value) => HEIGHT - BOTTOM - (value / most) * (HEIGHT - TOP - BOTTOM);
    const label = `${title} against ${column.heading}; the table above has the same numbers`;
    const drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "chart", role: "group", "aria-label": label });
    for (let value = 0; value <= most * 1.0001; value += step) {
      drawing.append(
        svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value) }),
        svg("text", { x: LEFT - 8, y: y(value) + 4, class: "tick end" }, said(value)));
    }
    for (const at of ticks(low, high)) {
      drawing.append(
        svg("line", { class: "grid", x1: x(at), x2: x(at), y1: TOP, y2: HEIGHT - BOTTOM }),
        svg("text", { x: x(at), y: HEIGHT - BOTTOM + 18, class: "tick middle" }, said(at)));
    }
    drawing.append(
      svg("text", { x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 8, class: "title middle" }, title),
      svg("text", { x: LEFT, y: TOP - 18, class: "title" }, `${column.heading}${column.unit ? ` [${column.unit}]` : ""}`));
    const points = rows.map((row) => {
      const [value, lo, hi] = row.values[column.id];
      const [cx, cy] = [x(fact(row, track, name)), y(value)];
      const bar = lo === null ? [cy, cy] : [y(Math.min(most, hi)), y(Math.max(0, lo))];
      return { row, value, cx, cy, bar, hasBar: lo !== null };
    });
    for (const { row, value, cx, cy, bar, hasBar, name: { x: nx, y: ny, end, away } } of named(points)) {
      const kind = [row.kind === "baseline" && "baseline", Table.isCut(row, track.name) && "cut"].filter(Boolean).join(" ");
      drawing.append(svg("a", { href: Site.address("model", { m: row.name }), class: `point ${kind}` },
        svg("title", {}, [`${row.name}: ${Table.text(value)}, ${said(fact(row, track, name))}`, Table.lacking(row, track.name)].filter(Boolean).join("; ")),
        hasBar ? svg("line", { class: "interval", x1: cx, x2: cx, y1: bar[0], y2: bar[1] }) : "",
        row.kind === "baseline" ? svg("rect", { x: cx - 4.5, y: cy - 4.5, width: 9, height: 9 }) : svg("circle", { cx, cy, r: 5 }),
        away ? svg("line", { class: "leader", x1: cx + (end ? -6 : 6), y1: cy, x2: nx + (end ? 2 : -2), y2: ny }) : "",
        svg("text", { x: nx, y: ny + 4, class: end ? "end" : null }, short(row.name))));
    }
    return { drawing, without };
  }

  const short = (name) => (name.length > 22 ? `${name.slice(0, 21)}…` : name);

  /** Points with the place of their name: beside the point, on the side and as near to its height as
      meets no other name, point or bar, and leaves the drawing nowhere. */
  function named(points) {
    const taken = points.map(({ cx, cy, bar }) => ({ left: cx - 5, right: cx + 5, top: Math.min(bar[0], cy - 5), bottom: Math.max(bar[1], cy + 5) }));
    return [...points].sort((a, b) => a.cy - b.cy).map((point) => {
      const width = short(point.row.name).length * LETTER;
      const places = SHIFTS.flatMap((shift) => [false, true].map((end) => {
        const [from, ny] = [point.cx + (end ? -14 : 14), point.cy + shift];
        return { x: from, y: ny, end, away: Math.abs(shift) > LINE / 2,
          box: { left: end ? from - width : from, right: end ? from : from + width, top: ny - LINE / 2, bottom: ny + LINE / 2 } };
      })).filter(({ box }) => box.left >= LEFT && box.right <= WIDTH && box.top >= 0 && box.bottom <= HEIGHT - BOTTOM);
      const meets = ({ box }) => taken.filter((one) => box.left < one.right && one.left < box.right && box.top < one.bottom && one.top < box.bottom).length;
      const name = places.find((place) => !meets(place)) || places.reduce((least, place) => (meets(place) < meets(least) ? place : least));
      taken.push(name.box);
      return { ...point, name };
    });
  }

  return { axes, draw };
})();
