/* What a ranking is shown by, on the site and in a report: bars, levels, errors, failures, all numbers.
   `to` gives addresses: `model(row)`, `error(row, name)`, and `part(row, cell)` where a number leads to
   its samples. */
"use strict";

const Ranking = (() => {
  const { text, DASH } = Table;
  const isModel = (row) => row.kind !== "baseline";
  const link = (href, ...children) => (href ? el("a", { href }, ...children) : el("span", {}, ...children));

  function isAbove(row, track, main) {
    const [, lo, hi] = row.values[main.id];
    return track.better === "lower" ? hi !== null && hi < track.floor.value : lo !== null && lo > track.floor.value;
  }

  // ---- the bars

  /** Ranked rows with a bar each; a line through all of them stands at the strongest blind baseline. */
  function bars(data, track, main, to) {
    if (!main) return el("p", { class: "muted" }, "Nothing is scored in this track.");
    const of = (kinds) => Table.sorted(data.rows.filter((row) => row.facts[track.name] && kinds(row)), { value: (row) => row.values[main.id]?.[0] ?? null }, track.better !== "lower");
    const models = of(isModel);
    const rows = models.length ? models : of(() => true);
    const lines = [track.floor && { ...track.floor, kind: "floor" }, chanceOf(data, track, main)].filter(Boolean);
    const ends = [...rows.filter((row) => row.values[main.id]).map((row) => row.values[main.id][2] ?? row.values[main.id][0]), ...lines.map(({ value }) => value)];
    const most = track.unit === "%" ? Math.min(100, Math.ceil(Math.max(...ends, 1) / 10) * 10) : Math.max(...ends) * 1.05;
    const at = (value) => `${Math.max(0, Math.min(100, (100 * value) / most))}%`;
    const marks = () => lines.map(({ value, kind }) => place(el("i", { class: `line ${kind}` }), { left: at(value) }));
    const parts = partsOf(data, track, main);
    const solved = rows.some((row) => row.facts[track.name]?.solved !== null && row.facts[track.name]?.solved !== undefined);
    return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Bars of ${track.title}` }, el("table", { class: "bars" },
      el("caption", { class: "unseen" }, `Models ranked by ${track.title}, ${track.main}`),
      el("thead", {}, el("tr", {},
        el("th", { scope: "col", class: "rank" }, "Rank"), el("th", { scope: "col", class: "text" }, "Model"),
        el("th", { scope: "col", class: "bar-head" }, el("span", { class: "labels" }, lines.map(({ name, value, kind }) =>
          place(el("span", { class: `label ${kind}` }, `${name} ${text(value)}`), { left: at(value) })))),
        el("th", { scope: "col" }, `${track.main}${track.unit ? ` (${track.unit})` : ""}`),
        solved ? el("th", { scope: "col" }, "Solved of all") : null,
        parts.length ? el("th", { scope: "col", class: "text" }, "Levels 1 to 4") : null)),
      el("tbody", {}, rows.map((row) => {
        const [value, lo, hi] = row.values[main.id] || [null, null, null];
        const fact = row.facts[track.name];
        const interval = lo === null ? null : place(el("i", { class: "interval" }), { left: at(lo), width: `calc(${at(hi)} - ${at(lo)})` });
        const lacking = Table.lacking(row, track.name);
        return el("tr", { class: `${row.kind}${value !== null && track.floor && isAbove(row, track, main) ? " above" : ""}` },
          el("td", { class: "rank number" }, Table.rank(row, track.name)),
          el("th", { scope: "row", class: "text name" }, link(to.model(row), row.name), lacking ? el("small", {}, lacking) : null),
          el("td", { class: "bar-cell" }, value === null ? null : place(el("i", { class: "value" }), { width: at(value) }), interval, marks()),
          el("td", { class: "number main" }, text(value), lo === null ? null : el("span", { class: "unseen" }, `, interval ${text(lo)} to ${text(hi)}`)),
          solved ? el("td", { class: "number" }, fact?.solved ?? DASH, el("span", { class: "muted" }, ` / ${fact?.done.toLocaleString("en")}`)) : null,
          parts.length ? el("td", { class: "text" }, sparkline(row, parts, most)) : null);
      }))));
  }

  function place(made, sides) {
    for (const [side, value] of Object.entries(sides)) made.style[side] = value;
    return made;
  }

  function chanceOf(data, track, main) {
    const row = data.rows.find(({ name, kind }) => name === "random" && kind === "baseline");
    return row?.values[main.id] && track.floor?.name !== "random" ? { name: "random", value: row.values[main.id][0], kind: "chance" } : null;
  }

  /** The columns of single levels beside the main one, in its setting. */
  const partsOf = (data, track, main) => (main ? data.columns.filter((column) =>
    column.track === track.name && column.setting === main.setting && /^Level \d$/.test(column.heading)) : []);

  function sparkline(row, parts, most) {
    const values = parts.map((part) => row.values[part.id]?.[0] ?? null);
    const top = Math.max(most, ...values.filter((value) => value !== null), 1);
    const points = values.map((value, i) => [6 + (i * 60) / Math.max(1, parts.length - 1), value === null ? null : 26 - (22 * value) / top]).filter(([, y]) => y !== null);
    return svg("svg", { viewBox: "0 0 72 30", class: "sparkline", role: "img", "aria-label": values.map((value, i) => `${parts[i].heading}: ${text(value)}`).join(", ") },
      svg("polyline", { points: points.map((point) => point.join(",")).join(" ") }),
      ...points.map(([x, y]) => svg("circle", { cx: x, cy: y, r: 2.2 })));
  }

  // ---- by level

  function slope(data, track, main, to) {
    const parts = partsOf(data, track, main);
    const rows = data.rows.filter((row) => isModel(row) && parts.every((part) => row.values[part.id]));
    if (parts.length < 2 || !rows.length) return null;
    const [width, height, left, right, top, bottom] = [760, 400, 46, 200, 18, 34];
    const floor = data.rows.find((row) => row.name === track.floor?.name && parts.every((part) => row.values[part.id]));
    const all = [...rows, ...(floor ? [floor] : [])];
    const most = Math.ceil(Math.max(...all.flatMap((row) => parts.map((part) => row.values[part.id][0]))) / 10) * 10;
    const step = most > 50 ? 20 : 10;
    const x = (i) => left + (i * (width - left - right)) / (parts.length - 1);
    const y = (value) => height - bottom - (value / most) * (height - top - bottom);
    const last = parts.length - 1;
    const ends = [...all].sort((a, b) => b.values[parts[last].id][0] - a.values[parts[last].id][0]);
    let below = -Infinity;
    const labels = ends.map((row) => {
      below = Math.max(below + 15, y(row.values[parts[last].id][0]) + 4);
      return { row, y: below };
    });
    const over = Math.max(0, labels.at(-1).y - (height - 6));
    const line = (row) => parts.map((part, i) => `${x(i)},${y(row.values[part.id][0])}`).join(" ");
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${height + over}`, class: "slope", role: "group", "aria-label": `${track.main} by level; the table below has the same numbers` },
      ...Array.from({ length: Math.floor(most / step) + 1 }, (_, n) => n * step).flatMap((value) => [
        svg("line", { class: "grid", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
        svg("text", { x: left - 8, y: y(value) + 4, class: "end tick" }, text(value, 0))]),
      ...parts.map((part, i) => svg("text", { x: x(i), y: height - 10, class: "middle tick" }, part.heading)),
      ...labels.map(({ row, y: at }) => svg("a", { href: to.model(row), class: row === floor ? "floor" : "model" },
        svg("polyline", { points: line(row) }),
        ...parts.map((part, i) => svg("circle", { cx: x(i), cy: y(row.values[part.id][0]), r: 3 })),
        svg("line", { class: "leader", x1: x(last) + 5, y1: y(row.values[parts[last].id][0]), x2: x(last) + 14, y2: at - 4 }),
        svg("text", { x: x(last) + 17, y: at }, row.name.length > 26 ? `${row.name.slice(0, 25)}…` : row.name))));
    return el("section", { "aria-labelledby": `levels-${track.name}` }, el("h2", { id: `levels-${track.name}` }, "By level"),
      el("p", { class: "muted" }, floor ? `Dashed: ${floor.name}, which never sees the goal.` : ""), el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Chart by level" }, drawing));
  }

  // ---- errors

  /** A bar a model: its wrong steps by type, each a way to its samples. */
  function losses(data, track, main, to) {
    const rows = Table.sorted(data.rows.filter((row) => Object.keys(row.facts[track.name]?.errors || {}).length),
      { value: (row) => row.values[main?.id]?.[0] ?? null }, track.better !== "lower");
    const names = track.errors.filter((name) => rows.some((row) => row.facts[track.name].errors[name]));
    if (!names.length) return null;
    return el("section", { class: "losses", "aria-labelledby": `errors-${track.name}` }, el("h2", { id: `errors-${track.name}` }, "Wrong steps by type"),
      el("p", { class: "keys-of" }, names.map((name, i) => el("span", { class: `key error-${i}` }, Words.named(name)))),
      el("div", { class: "stacks" }, rows.flatMap((row) => [
        link(to.model(row), row.name),
        el("span", { class: "stack" }, names.map((name, i) => {
          const share = row.facts[track.name].errors[name] || 0;
          if (!share) return null;
          const said = `${row.name}, ${Words.named(name)}: ${text(share)} %`;
          return place(el("a", { class: `error-${i}`, href: to.error(row, name), title: said, "aria-label": said }), { width: `${share}%` });
        }))])));
  }

  // ---- how models fail

  /** A sample at its first wrong step, beside its goal; null where nothing can be drawn. */
  async function failure({ scene, record, name, href }) {
    const score = scene && (record.scores || []).find(({ placed }) => placed);
    if (!score) return null;
    const shown = Steps.asShown(scene, record);
    const run = Runs.of(shown, record, score.setting, score);
    const at = run.steps.findIndex((step) => step.why);
    const step = run.steps[at];
    const canvases = ["goal", "stage"].map((kind) => el("canvas", { class: `picture ${kind}`, role: "img",
      "aria-label": kind === "goal" ? "The goal" : `Step ${at + 1}: ${step.verdict}` }));
    const item = el("li", {}, link(href,
      el("span", { class: "pair" }, el("figure", {}, canvases[0], el("figcaption", {}, "Goal")), el("figure", {}, canvases[1], el("figcaption", {}, `Step ${at + 1}`))),
      el("strong", {}, step.verdict), el("span", {}, ` ${name}: ${step.text}`)));
    const draw = () => {
      canvases[0].drawing = [shown.blocks, { grid: true }];
      canvases[1].drawing = [run.states[at + 1][0].blocks, { framed: shown.blocks, grid: true, tried: Overlay.block(shown, step), triedBadge: String(step.number) }];
      Stage.draw(item);
    };
    return { item, draw, scene: shown, run, name };
  }

  // ---- all numbers

  /** The whole table; a click on a heading sorts it. */
  function numbers(data, track, main, to, sorted = { id: main?.id }) {
    const columns = Table.columns(data, track);
    const sorting = columns.find(({ id }) => id === sorted.id) || columns[0];
    const down = sorted.down ?? sorting.better !== "lower";
    const sort = (column) => {
      const again = numbers(data, track, main, to, { id: column.id, down: column === sorting ? !down : column.better !== "lower" });
      made.replaceWith(again);
      [...again.querySelectorAll("button")].find((button) => button.dataset.column === column.id).focus();
    };
    const rows = Table.sorted(data.rows, sorting, down);
    const spans = [];
    for (const { over } of columns) {
      if (spans.length && spans.at(-1).over === over) spans.at(-1).span += 1;
      else spans.push({ over, span: 1 });
    }
    const made = el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `All numbers of ${track.title}` }, el("table", { class: "board" },
      el("caption", { class: "unseen" }, `All numbers of ${track.title}`),
      el("thead", {}, el("tr", {}, el("td", {}), spans.map(({ over, span }) => (over ? el("th", { scope: "colgroup", colspan: span, class: "over" }, over) : el("td", { colspan: span })))),
        el("tr", {}, el("th", { scope: "col", class: "text name" }, "Model"), columns.map((column) => el("th", { scope: "col", title: column.about || null,
          "aria-sort": column === sorting ? (down ? "descending" : "ascending") : null },
        el("button", { type: "button", "data-column": column.id, onclick: () => sort(column) }, column.heading))))),
      el("tbody", {}, rows.map((row) => el("tr", { class: row.kind },
        el("th", { scope: "row", class: "text name" }, link(to.model(row), row.name), isModel(row) ? null : el("small", {}, "baseline")),
        columns.map((column) => {
          const { text: shown, below, isText } = column.cell(row);
          return el("td", { class: [column.id === main?.id && "main", isText && "text"].filter(Boolean).join(" ") || null }, to.part && column.part && shown !== DASH ? link(to.part(row, column.part), shown) : shown, below ? el("small", {}, below) : null);
        }))))));
    return made;
  }

  return { bars, slope, losses, failure, numbers };
})();
