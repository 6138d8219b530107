/* The first page of a site: the finding, the ranking as bars, what it looks like, and how to take part. */
"use strict";

const Board = (() => {
  const { text, DASH } = Table;
  const LOOP_MS = 900;
  const REST_MS = 2600;
  const link = (view, words, ...children) => el("a", { href: Site.address(view, words) }, ...children);
  const isModel = (row) => row.kind !== "baseline";
  let clock = null;

  async function view(words) {
    const data = await Store.openBoard();
    const track = data.tracks.find(({ name }) => name === words.get("by")) || data.tracks[0];
    const main = data.columns.find((column) => column.track === track.name && column.heading === track.main);
    const hero = el("div", { class: "hero-build", "aria-hidden": "true" });
    const failures = el("ul", { class: "failures" });
    return [
      el("section", { class: "hero" },
        el("div", { class: "hero-text" },
          el("h1", {}, data.title),
          el("p", { class: "lead" }, document.querySelector("meta[name=description]").content.split(". ")[0] + "."),
          el("p", { class: "finding" }, track.finding),
          el("p", { class: "muted" }, "Try it yourself: ", el("code", {}, "phyblock play quick"), " gives you the models' own tasks in a browser.")),
        hero),
      el("section", { "aria-labelledby": "ranking" }, el("h2", { id: "ranking" }, "Ranking"), choice(data, track, words), bars(data, track, main)),
      slope(data, track, main),
      el("section", { id: "failures", hidden: true, "aria-labelledby": "failures-title" },
        el("h2", { id: "failures-title" }, "How they fail"), failures),
      more(data, track, main, words),
      method(data, track),
      filled(hero, failures),
    ].filter((part) => part instanceof Node);
  }

  function isAbove(row, track, main) {
    const [, lo, hi] = row.values[main.id];
    return track.better === "lower" ? hi !== null && hi < track.floor.value : lo !== null && lo > track.floor.value;
  }

  function choice(data, track, words) {
    if (data.tracks.length < 2) return null;
    return el("label", { class: "choice" }, el("span", {}, "Ranked by"),
      el("select", { id: "by", onchange: (event) => Site.go("board", { by: event.target.value === data.tracks[0].name ? "" : event.target.value, more: words.get("more") }) },
        data.tracks.map((one) => el("option", { value: one.name, selected: one === track }, `${one.title}: ${one.main}`))));
  }

  // ---- the bars

  /** Ranked rows with a bar each; a line through all of them stands at the strongest blind baseline. */
  function bars(data, track, main) {
    if (!main) return el("p", { class: "muted" }, "Nothing is scored in this track.");
    const shown = Table.sorted(data.rows.filter((row) => isModel(row) && row.values[main.id]), { value: (row) => row.values[main.id][0] }, track.better !== "lower");
    const rows = shown.length ? shown : Table.sorted(data.rows.filter((row) => row.values[main.id]), { value: (row) => row.values[main.id][0] }, track.better !== "lower");
    const lines = [track.floor && { ...track.floor, kind: "floor" }, chanceOf(data, track, main)].filter(Boolean);
    const ends = [...rows.map((row) => row.values[main.id][2] ?? row.values[main.id][0]), ...lines.map(({ value }) => value)];
    const most = track.unit === "%" ? Math.min(100, Math.ceil(Math.max(...ends, 1) / 10) * 10) : Math.max(...ends) * 1.05;
    const at = (value) => `${Math.max(0, Math.min(100, (100 * value) / most))}%`;
    const marks = () => lines.map(({ value, kind }) => place(el("i", { class: `line ${kind}` }), { left: at(value) }));
    const parts = partsOf(data, track, main);
    const solved = rows.some((row) => row.facts[track.name]?.solved !== null && row.facts[track.name]?.solved !== undefined);
    return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Ranking" }, el("table", { class: "bars" },
      el("caption", { class: "unseen" }, `Models ranked by ${track.title}, ${track.main}`),
      el("thead", {}, el("tr", {},
        el("th", { scope: "col", class: "rank" }, "Rank"), el("th", { scope: "col", class: "text" }, "Model"),
        el("th", { scope: "col", class: "bar-head" }, el("span", { class: "labels" }, lines.map(({ name, value, kind }) =>
          place(el("span", { class: `label ${kind}` }, `${name} ${text(value)}`), { left: at(value) })))),
        el("th", { scope: "col" }, `${track.main}${track.unit ? ` (${track.unit})` : ""}`),
        solved ? el("th", { scope: "col" }, "Solved of all") : null,
        parts.length ? el("th", { scope: "col", class: "text" }, "Levels 1 to 4") : null)),
      el("tbody", {}, rows.map((row) => {
        const [value, lo, hi] = row.values[main.id];
        const fact = row.facts[track.name];
        const interval = lo === null ? null : place(el("i", { class: "interval" }), { left: at(lo), width: `calc(${at(hi)} - ${at(lo)})` });
        const lacking = Table.lacking(row, track.name);
        return el("tr", { class: `${row.kind}${track.floor && isAbove(row, track, main) ? " above" : ""}` },
          el("td", { class: "rank number" }, Table.rank(row, track.name)),
          el("th", { scope: "row", class: "text name" }, link("model", { m: row.name }, row.name), lacking ? el("small", {}, lacking) : null),
          el("td", { class: "bar-cell" }, place(el("i", { class: "value" }), { width: at(value) }), interval, marks()),
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

  function slope(data, track, main) {
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
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${height + over}`, class: "slope", role: "img", "aria-label": `${track.main} by level; the table below has the same numbers` },
      ...Array.from({ length: Math.floor(most / step) + 1 }, (_, n) => n * step).flatMap((value) => [
        svg("line", { class: "grid", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
        svg("text", { x: left - 8, y: y(value) + 4, class: "end tick" }, text(value, 0))]),
      ...parts.map((part, i) => svg("text", { x: x(i), y: height - 10, class: "middle tick" }, part.heading)),
      ...labels.map(({ row, y: at }) => svg("a", { href: Site.address("model", { m: row.name }), class: row === floor ? "floor" : "model" },
        svg("polyline", { points: line(row) }),
        ...parts.map((part, i) => svg("circle", { cx: x(i), cy: y(row.values[part.id][0]), r: 3 })),
        svg("line", { class: "leader", x1: x(last) + 5, y1: y(row.values[parts[last].id][0]), x2: x(last) + 14, y2: at - 4 }),
        svg("text", { x: x(last) + 17, y: at }, row.name.length > 26 ? `${row.name.slice(0, 25)}…` : row.name))));
    return el("section", { "aria-labelledby": "levels" }, el("h2", { id: "levels" }, "By level"),
      el("p", { class: "muted" }, floor ? `Dashed: ${floor.name}, which never sees the goal.` : ""), el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "By level" }, drawing));
  }

  // ---- what it looks like

  /** Once the page stands, bring what its pictures need; where it cannot be drawn, they stay away. */
  function filled(hero, failures) {
    setTimeout(async () => {
      const index = await Store.openSamples();
      const known = index.starts.scenes.length ? index.telling : [];
      const cards = await Promise.all(known.map(({ row }) => card(Store.sample(row))));
      const drawn = cards.filter(Boolean);
      if (!drawn.length || !failures.isConnected) return hero.remove();
      failures.append(...drawn.map(({ item }) => item));
      failures.closest("section").hidden = false;
      for (const one of drawn) one.draw();
      return loop(hero, drawn[0]);
    });
  }

  async function card(sample) {
    const [scene, record] = [await Store.entry("scenes", sample.sceneNumber), await Store.entry("replays", sample.row)];
    const score = scene && (record.scores || []).find(({ placed }) => placed);
    if (!score) return null;
    const shown = Steps.asShown(scene, record);
    const run = Runs.of(shown, record, score.setting, score);
    const at = run.steps.findIndex((step) => step.why);
    const step = run.steps[at];
    const canvases = ["goal", "stage"].map((kind) => el("canvas", { class: `picture ${kind}`, role: "img",
      "aria-label": kind === "goal" ? "The goal" : `Step ${at + 1}: ${step.verdict}` }));
    const item = el("li", {}, link("replay", Site.wordsOf(sample),
      el("span", { class: "pair" }, el("figure", {}, canvases[0], el("figcaption", {}, "Goal")), el("figure", {}, canvases[1], el("figcaption", {}, `Step ${at + 1}`))),
      el("strong", {}, step.verdict), el("span", {}, ` ${sample.entry.name}: ${step.text}`)));
    const draw = () => {
      canvases[0].drawing = [shown.blocks, { grid: true }];
      canvases[1].drawing = [run.states[at + 1][0].blocks, { framed: shown.blocks, grid: true, tried: Overlay.block(shown, step), triedBadge: String(step.number) }];
      Stage.draw(item);
    };
    return { item, draw, scene: shown, run, sample };
  }

  /** The goal, its candidates and the build, which begins again after its end. */
  function loop(hero, { scene, run, sample }) {
    const goal = Stage.picture("The goal", scene.blocks, { grid: true });
    const built = Stage.picture("What was built", [], { framed: scene.blocks, grid: true });
    const said = el("p", { class: "muted" });
    hero.append(
      el("figure", {}, el("figcaption", {}, "Goal"), goal),
      el("ol", { class: "hero-candidates" }, scene.candidates.map((candidate, i) => el("li", {},
        el("span", { class: "number" }, String(i + 1)), Stage.picture(`Candidate ${i + 1}`, [Solid.onTheFloor(candidate)], { minDistance: 0 }, "cell")))),
      el("figure", {}, el("figcaption", {}, `Built by ${sample.entry.name}`), built, said));
    Stage.draw(hero);
    const end = run.steps.length;
    let at = matchMedia("(prefers-reduced-motion: reduce)").matches ? end : 0;
    const tick = () => {
      if (!hero.isConnected) return;
      const state = run.states[at][0], step = run.steps[at - 1];
      const tried = step?.why ? Overlay.block(scene, step) : null;
      built.drawing = [state.blocks, { ...state, ghosts: [], framed: scene.blocks, grid: true, tried, triedBadge: tried ? String(step.number) : "" }];
      said.textContent = step ? `Step ${at}: candidate ${step.number}${step.why ? ` ✗ ${step.verdict}` : " ✓"}` : "";
      Stage.draw(built.parentElement);
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
      clock = setTimeout(tick, at === end ? REST_MS : LOOP_MS);
      at = at === end ? 0 : at + 1;
    };
    clearTimeout(clock);
    tick();
  }

  // ---- all numbers

  function more(data, track, main, words) {
    const part = el("details", { class: "more", id: "more", open: words.get("more") ? true : null },
      el("summary", {}, "All numbers: intervals, settings, tokens and cost"), numbers(data, track, main, words), chart(data, track, main, words));
    part.addEventListener("toggle", () => {
      const now = Site.address("board", { ...Object.fromEntries(words), more: part.open ? "1" : "" });
      history.replaceState(null, "", now);
    });
    return part;
  }

  function numbers(data, track, main, words) {
    const columns = Table.columns(data, track);
    const sorting = columns.find(({ id }) => id === words.get("sort")) || columns.find(({ id }) => id === main?.id) || columns[0];
    const down = words.get("down") !== null ? words.get("down") === "1" : sorting.better !== "lower";
    const rows = Table.sorted(data.rows, sorting, down);
    const spans = [];
    for (const { over } of columns) {
      if (spans.length && spans.at(-1).over === over) spans.at(-1).span += 1;
      else spans.push({ over, span: 1 });
    }
    return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "All numbers" }, el("table", { class: "board" },
      el("caption", { class: "unseen" }, `All numbers of ${track.title}`),
      el("thead", {}, el("tr", {}, el("td", {}), spans.map(({ over, span }) => (over ? el("th", { scope: "colgroup", colspan: span, class: "over" }, over) : el("td", { colspan: span })))),
        el("tr", {}, el("th", { scope: "col", class: "text name" }, "Model"), columns.map((column) => el("th", { scope: "col", title: column.about || null,
          "aria-sort": column === sorting ? (down ? "descending" : "ascending") : null },
        el("button", { type: "button", "data-column": column.id, onclick: () => Site.go("board", { ...Object.fromEntries(words), more: "1", sort: column.id, down: (column === sorting ? !down : column.better !== "lower") ? "1" : "0" }) }, column.heading))))),
      el("tbody", {}, rows.map((row) => el("tr", { class: row.kind },
        el("th", { scope: "row", class: "text name" }, link("model", { m: row.name }, row.name), isModel(row) ? null : el("small", {}, "baseline")),
        columns.map((column) => {
          const { text: shown, below, isText } = column.cell(row);
          return el("td", { class: [column.id === main?.id && "main", isText && "text"].filter(Boolean).join(" ") || null }, shown, below ? el("small", {}, below) : null);
        }))))));
  }

  function chart(data, track, main, words) {
    const axes = main ? Chart.axes(data, track) : [];
    if (!axes.length) return null;
    const axis = axes.some(([name]) => name === words.get("x")) ? words.get("x") : axes[0][0];
    const { drawing, without } = Chart.draw(data, track, main, axis);
    return el("section", { class: "costs" }, el("h3", {}, "Cost against score"),
      el("label", { class: "choice" }, el("span", {}, "Across"), el("select", { id: "axis", onchange: (event) => Site.go("board", { ...Object.fromEntries(words), more: "1", x: event.target.value }) },
        axes.map(([name, title]) => el("option", { value: name, selected: name === axis }, title)))),
      el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Cost against score" }, drawing),
      without.length ? el("p", { class: "notes" }, `Not drawn, as nothing is known: ${without.map((row) => row.name).join(", ")}.`) : null);
  }

  // ---- how it was done

  function method(data, track) {
    const { runs } = data;
    const samples = data.rows.flatMap((row) => Object.values(row.facts)).reduce((sum, fact) => sum + fact.done, 0);
    const dates = runs.map((run) => run.date).filter(Boolean).sort();
    const verified = runs.filter((run) => run.verified).length;
    return el("section", { class: "method", "aria-labelledby": "method" }, el("h2", { id: "method" }, "Method"),
      el("ul", { class: "notes" },
        el("li", {}, `${Words.count(data.rows.filter(isModel).length, "model")}, ${Words.count(samples, "sample")}${runs[0].data ? ` on ${runs[0].data}, version ${runs[0].version}` : ""}${dates.length ? `, ${dates[0] === dates.at(-1) ? dates[0] : `${dates[0]} to ${dates.at(-1)}`}` : ""}. ${verified ? `${verified} of ${Words.count(runs.length, "run")} independently re-scored.` : ""}`),
        track.notes.map((note) => el("li", {}, note)),
        el("li", {}, "Thin bars are 95 % intervals: jackknife over base scenes. Ranks are ranges: paired tests of every pair of models, corrected for their number (Holm). Baselines have no rank, nor have models that are not complete."),
        track.physics ? el("li", {}, `${track.title}: what fell is taken from the records; physics is not run again.`) : null),
      el("h3", {}, "Take part"),
      el("p", {}, "Run the suite, then send the bundle; it is scored again before it is listed:"),
      el("pre", {}, el("code", {}, `phyblock run ${runs[0].suite || "full"} --models my-model\nphyblock bundle results/${runs[0].suite || "full"}-… --out my-model.zip`)),
      el("h3", {}, "Cite"),
      el("p", { class: "notes" }, "Ma, Wen, Lin, Xu, Liang, Lin et al.: PhyBlock: A Progressive Benchmark for Physical Understanding and Planning via 3D Block Assembly. NeurIPS 2025, Datasets and Benchmarks Track."));
  }

  return { view };
})();
