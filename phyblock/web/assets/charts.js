/* Charts: ranked bars, lines by level, wrong steps by type, and bars of single scores. */
"use strict";

const Charts = (() => {
  const { number } = Words;
  const modelLink = (row) => el("a", { href: App.address("model", { m: row.name }) }, row.name);
  const valueOf = (row, column) => row.values[column?.id]?.[0] ?? null;

  /** The rows of a track, the best first: models, or where there are none all. */
  function ranked(track) {
    const rows = Data.board.rows.filter((row) => row.facts[track.name]);
    const models = rows.filter(Data.isModel), main = Data.mainOf(track);
    return Table.sorted(models.length ? models : rows, (row) => valueOf(row, main), track.better !== "lower");
  }

  function isAbove(row, track) {
    const [, lo, hi] = row.values[Data.mainOf(track).id];
    return track.better === "lower" ? hi !== null && hi < track.floor.value : lo !== null && lo > track.floor.value;
  }

  /** Round numbers from 0 on, six at most. */
  function ticksTo(most) {
    const step = [1, 2, 5, 10, 20, 25, 50].map((n) => [n / 100, n, 100 * n]).flat().sort((a, b) => a - b).find((n) => most / n < 6);
    return Array.from({ length: Math.floor(most / step) + 1 }, (_, n) => n * step);
  }

  /** Numbers of an axis below bars. */
  const axis = (ticks, at) => el("span", { class: "axis number", "aria-hidden": "true" },
    ticks.map((value) => el("span", { style: { left: at(value) } }, String(value))));

  /** Ranked rows with a bar each; a line through all of them stands at the strongest blind baseline. */
  function bars(track) {
    const main = Data.mainOf(track), rows = ranked(track), levels = Data.levelsOf(track);
    const random = Data.board.rows.find(({ model, kind }) => model === "random" && kind === "baseline");
    const chance = track.floor?.name === "random" ? null : random && valueOf(random, main);
    const lines = [track.floor && [track.floor.name, track.floor.value, "floor"],
      chance !== null && chance !== undefined && ["random", chance, "chance"]].filter(Boolean);
    const ends = rows.map((row) => row.values[main.id]?.[2] ?? valueOf(row, main) ?? 0);
    const most = Math.max(...ends, ...lines.map(([, value]) => value), 1e-9) * 1.05;
    const at = (value) => `${Math.max(0, Math.min(100, (100 * value) / most))}%`;
    const hasSolved = track.best !== null, ticks = ticksTo(most);
    const isBest = (row) => row.values[main.id] && track.floor && isAbove(row, track);
    const columns = [["rank", "Rank"], ["text", "Model"], ["bar-head", el("span", { class: "labels" }, lines.map(([name, value, kind]) =>
      // Moved by the same share of its width, a label stays within its column.
      el("span", { class: kind, style: { left: at(value), transform: `translateX(-${at(value)})` } }, `${name} ${number(value)}`, kind === "floor" ? el("span", { class: "why" }, ", which never sees the goal") : null)))],
    ["", `${track.main}${track.unit ? ` (${track.unit})` : ""}`], hasSolved && ["", "Solved of all"],
    levels.length && ["text", "Levels 1 to 4"]].filter(Boolean);
    const bar = (row) => {
      const [value, lo, hi] = row.values[main.id] || [null, null, null];
      const fact = row.facts[track.name], lacking = Table.lacking(row, track);
      return el("tr", { class: `${row.kind}${isBest(row) ? " above" : ""}` },
        el("td", { class: "rank number" }, Table.rank(row, track)),
        el("th", { scope: "row", class: "text name" }, modelLink(row), lacking ? el("small", {}, lacking) : null),
        el("td", { class: "bar-cell" }, ticks.map((tick) => el("i", { class: "tick", style: { left: at(tick) } })), value === null ? null : el("i", { class: "value", style: { width: at(value) } }),
          lo === null ? null : el("i", { class: "interval", style: { left: at(lo), width: `calc(${at(hi)} - ${at(lo)})` } }),
          lines.map(([, value, kind]) => el("i", { class: `line ${kind}`, style: { left: at(value) } }))),
        el("td", { class: "number main" }, number(value), lo === null ? null : el("span", { class: "unseen" }, `, interval ${number(lo)} to ${number(hi)}`)),
        hasSolved ? el("td", { class: "number" }, number(fact.solved, 0), el("span", { class: "muted" }, ` / ${number(fact.recorded, 0)}`)) : null,
        levels.length ? el("td", { class: "text" }, sparkline(row, levels, most)) : null);
    };
    const key = (kind, text) => el("span", { class: `key ${kind}` }, text);
    return [scrolled(`Bars of ${track.title}`, el("table", { class: "bars" },
      el("caption", { class: "unseen" }, `Models ranked by ${track.title}, ${track.main}`),
      el("thead", {}, el("tr", {}, columns.map(([kind, heading]) => el("th", { scope: "col", class: kind || null }, heading)))),
      el("tbody", {}, rows.map(bar)),
      el("tfoot", {}, el("tr", {}, el("td", { colspan: 2 }), el("td", {}, axis(ticks, at)))))),
    el("p", { class: "keys" }, key("value", track.main), key("interval", "95 % interval"),
      rows.some(isBest) ? key("above", `all of its interval is better than ${track.floor.name}`) : null)];
  }

  function sparkline(row, levels, most) {
    const values = levels.map((level) => valueOf(row, level));
    const top = Math.max(most, ...values);
    const points = values.flatMap((value, i) => (value === null ? [] : [[6 + (i * 60) / Math.max(1, levels.length - 1), 26 - (22 * value) / top]]));
    return svg("svg", { viewBox: "0 0 72 30", class: "sparkline", role: "img", "aria-label": values.map((value, i) => `${levels[i].heading}: ${number(value)}`).join(", ") },
      svg("polyline", { points: points.map((point) => point.join(",")).join(" ") }),
      points.map(([cx, cy]) => svg("circle", { cx, cy, r: 2.2 })));
  }

  /** A line a model over the levels, with its name at the end; dashed: the strongest blind baseline. */
  function slope(track) {
    const levels = Data.levelsOf(track), isWhole = (row) => levels.every((level) => row.values[level.id]);
    const rows = ranked(track).filter(isWhole);
    if (levels.length < 2 || !rows.length) return null;
    const isNarrow = innerWidth < 700, longest = isNarrow ? 22 : 28;
    const [width, height, left, right, top, bottom] = isNarrow ? [420, 320, 30, 170, 18, 34] : [860, 380, 46, 220, 18, 34];
    const floor = Data.board.rows.find((row) => row.model === track.floor?.name && isWhole(row));
    const all = [...new Set([...rows, ...(floor ? [floor] : [])])], end = levels.at(-1);
    const most = Math.max(...all.flatMap((row) => levels.map((level) => valueOf(row, level))), 1);
    const x = (i) => left + (i * (width - left - right)) / (levels.length - 1);
    const y = (value) => height - bottom - (value / most) * (height - top - bottom);
    let below = -Infinity;
    const labels = Table.sorted(all, (row) => valueOf(row, end)).map((row) => {
      below = Math.max(below + 15, y(valueOf(row, end)) + 4);
      return [row, below];
    });
    const line = ([row, at]) => svg("a", { href: App.address("model", { m: row.name }), class: row === floor ? "floor" : "model" },
      svg("polyline", { points: levels.map((level, i) => `${x(i)},${y(valueOf(row, level))}`).join(" ") }),
      levels.map((level, i) => svg("circle", { cx: x(i), cy: y(valueOf(row, level)), r: 3 })),
      svg("line", { class: "leader", x1: x(levels.length - 1) + 5, y1: y(valueOf(row, end)), x2: width - right + 24, y2: at - 4 }),
      svg("text", { x: width - right + 28, y: at }, row.name.length > longest ? `${row.name.slice(0, longest - 1)}…` : row.name));
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${Math.max(height, below + 6)}`, class: "slope", role: "group", "aria-label": `${track.main} by level; the table of all numbers has them too` },
      ticksTo(most).map((value) => [svg("line", { class: "grid", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
        svg("text", { x: left - 8, y: y(value) + 4, class: "end" }, number(value, 0))]),
      levels.map((level, i) => svg("text", { x: x(i), y: height - 10, class: "middle" }, level.heading)), labels.map(line));
    return [el("h3", {}, `${track.main} by level${track.unit && ` (${track.unit})`}`), floor ? el("p", { class: "muted" }, `Dashed: ${floor.name}, which never sees the goal.`) : null,
      scrolled(`${track.title} by level`, drawing)];
  }

  /** A bar a model: its wrong steps by type, each a way to its samples. Of one alone the key has the numbers. */
  function losses(track, asked = ranked(track)) {
    const rows = asked.filter((row) => Object.keys(row.facts[track.name].errors).length);
    const share = (name) => (asked.length > 1 ? "" : ` ${number(rows[0].facts[track.name].errors[name])} %`);
    const names = track.errors.filter((name) => rows.some((row) => row.facts[track.name].errors[name]));
    if (!names.length) return null;
    const part = (row) => (name, i) => {
      const share = row.facts[track.name].errors[name];
      const said = `${row.name}, ${Words.named(name)}: ${number(share)} %`;
      return share ? el("a", { class: `error-${i}`, style: { width: `${share}%` }, title: said, "aria-label": said,
        href: App.address("samples", { track: track.name, model: row.name, error: name }) }) : null;
    };
    return [el("h3", {}, "Wrong steps by type (% of a model's wrong steps)"),
      el("p", { class: "keys" }, names.map((name, i) => el("span", { class: `key error-${i}` }, Words.named(name), share(name)))),
      el("div", { class: "stacks" }, rows.flatMap((row) => [modelLink(row), el("span", { class: "stack" }, names.map(part(row)))]),
        el("span"), axis([0, 25, 50, 75, 100], (value) => `${value}%`))];
  }

  /** A score as a number with a bar below. */
  function score(value, track, text = number(value)) {
    const share = value === null || track.best === null ? 0
      : Math.max(0, Math.min(1, track.better === "lower" ? 1 - value / (track.best || 100) : value / track.best));
    return el("span", { class: "score number" }, text, el("span", { class: "score-bar" }, el("i", { style: { width: `${100 * share}%` } })));
  }

  return { ranked, bars, slope, losses, score };
})();
