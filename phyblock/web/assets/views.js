/* The pages but for replays: the board, a model, all scenes, a scene. */
"use strict";

const Views = (() => {
  const { text, DASH } = Table;
  const link = (view, words, ...children) => el("a", { href: Site.address(view, words) }, ...children);
  const capital = (name) => name[0].toUpperCase() + name.slice(1);
  const plural = (n, noun) => Words.count(n, noun);

  // ---- the board

  async function board(words) {
    const data = await Store.openBoard();
    const track = data.tracks.find(({ name }) => name === words.get("by")) || data.tracks[0];
    const groups = Table.groups(data);
    const all = new Map(groups.flatMap(({ columns }) => columns.map((column) => [column.id, column])));
    const wanted = (words.get("cols") ? words.get("cols").split("~") : Table.usual(data)).filter((id) => all.has(id));
    const main = mainOf(data, track);
    const state = {
      by: track.name, cols: words.get("cols") || "", sort: all.has(words.get("sort")) ? words.get("sort") : main?.id,
      down: words.get("down") !== null ? words.get("down") === "1" : track.better === "higher",
      axis: words.get("x") || "", data, track, groups, all, wanted, main,
    };
    const runs = data.runs;
    const samples = data.rows.flatMap((row) => Object.values(row.facts)).reduce((sum, fact) => sum + fact.done, 0);
    const dates = runs.map((run) => run.date).filter(Boolean).sort();
    const facts = [
      ["Models", data.rows.length], ["Samples", samples.toLocaleString("en")], ["Runs", runs.length],
      ["Data", runs[0].data ? `${runs[0].data}, version ${runs[0].version}` : DASH],
      ["Runs begun", dates.length ? (dates[0] === dates.at(-1) ? dates[0] : `${dates[0]} to ${dates.at(-1)}`) : DASH],
      ["Scored again", `${runs.filter((run) => run.verified).length} of ${plural(runs.length, "run")}`],
    ];
    return [
      el("h1", {}, data.title),
      el("dl", { class: "about" }, facts.map(([name, value]) =>
        el("div", {}, el("dt", {}, name), el("dd", { class: "number" }, String(value))))),
      el("section", { class: "ranking", "aria-labelledby": "ranking" },
        el("h2", { id: "ranking" }, "Ranking"), tools(state), table(state), notes(state)),
      chart(state),
    ].filter(Boolean);
  }

  const mainOf = (data, track) =>
    data.columns.find((column) => column.track === track.name && column.heading === track.main);

  const go = (state, changes) => {
    const { by, cols, sort, down, axis } = { ...state, ...changes };
    Site.go("board", { by: by === state.data.tracks[0].name ? "" : by, cols,
      sort: sort === state.main?.id ? "" : sort, down: sort === state.main?.id && down === (state.track.better === "higher") ? "" : down ? "1" : "0", x: axis });
  };

  function tools(state) {
    const { data, track } = state;
    const choice = data.tracks.length > 1 ? el("label", { class: "choice" }, el("span", {}, "Ranked by"),
      el("select", { id: "by", onchange: (event) => go(state, { by: event.target.value, sort: "", down: true, axis: "" }) },
        data.tracks.map((one) => el("option", { value: one.name, selected: one === track }, `${one.title}: ${one.main}`)))) : null;
    const boxes = state.groups.map((group) => el("fieldset", {}, el("legend", {}, group.title),
      group.columns.map((column) => el("label", {}, el("input", { type: "checkbox", value: column.id,
        checked: state.wanted.includes(column.id), onchange: (event) => toggle(state, column.id, event.target.checked) }), ` ${column.heading}`))));
    const menu = el("details", { class: "columns-menu", id: "columns" },
      el("summary", {}, `Columns (${state.wanted.length} of ${state.all.size})`),
      el("div", { class: "column-groups" }, boxes),
      el("button", { type: "button", class: "quiet", onclick: () => go(state, { cols: "" }) }, "The usual columns"));
    menu.open = Site.kept("phyblock-site-columns") === "yes";
    menu.addEventListener("toggle", () => Site.kept("phyblock-site-columns", menu.open ? "yes" : "no"));
    return el("div", { class: "tools" }, choice, menu);
  }

  function toggle(state, id, isOn) {
    // Columns keep the order of the menu, whatever was clicked first.
    const chosen = new Set(isOn ? [...state.wanted, id] : state.wanted.filter((one) => one !== id));
    const isUsual = Table.usual(state.data);
    const ids = isUsual.every((one) => chosen.has(one)) && chosen.size === isUsual.length ? ""
      : [...state.all.keys()].filter((one) => chosen.has(one)).join("~");
    go(state, { cols: ids });
  }

  function table(state) {
    const columns = state.wanted.map((id) => state.all.get(id));
    const sorting = state.all.get(state.sort) || state.all.get(state.main?.id);
    const rows = sorting ? Table.sorted(state.data.rows, sorting, state.down) : state.data.rows;
    const bySetting = columns.some((column) => column.setting);
    const grouped = columns.some((column) => column.group);
    const over = (column) => [grouped && column.group, bySetting && column.setting && `setting ${column.setting}`].filter(Boolean).join(", ");
    const heads = columns.map((column) => {
      const isSorted = column === sorting;
      const down = isSorted ? !state.down : column.better !== "lower";
      return el("th", { scope: "col", "aria-sort": isSorted ? (state.down ? "descending" : "ascending") : null,
        class: column.isMain ? "main" : null, title: column.about || null },
      el("button", { type: "button", "data-column": column.id, onclick: () => go(state, { sort: column.id, down }) }, column.heading));
    });
    const spans = [];
    for (const name of columns.map(over)) {
      if (spans.length && spans.at(-1).name === name) spans.at(-1).span += 1;
      else spans.push({ name, span: 1 });
    }
    const above = columns.some(over) ? el("tr", {}, el("td", { colspan: 2 }), spans.map(({ name, span }) =>
      (name ? el("th", { scope: "colgroup", colspan: span, class: "over" }, capital(name)) : el("td", { colspan: span })))) : null;
    return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Table of the ranking" },
      el("table", { class: "board" },
        el("caption", { class: "unseen" }, `Models ranked by ${state.track.title}, ${state.track.main}`),
        el("thead", {}, above, el("tr", {}, el("th", { scope: "col", class: "rank" }, "Rank"), el("th", { scope: "col", class: "text name" }, "Model"), heads)),
        el("tbody", {}, rows.map((row) => el("tr", { class: row.kind },
          el("td", { class: "rank number" }, Table.rank(row, state.track.name)),
          el("th", { scope: "row", class: "text name" }, link("model", { m: row.name }, row.name),
            row.kind === "baseline" ? el("small", {}, "baseline") : null,
            Table.lacking(row, state.track.name) ? el("small", {}, Table.lacking(row, state.track.name)) : null),
          columns.map((column) => cell(row, column)))))));
  }

  function cell(row, column) {
    const { text: shown, below, strip, isText } = column.cell(row);
    return el("td", { class: [column.isMain && "main", isText && "text"].filter(Boolean).join(" ") || null }, shown,
      column.isMain && strip ? Table.strip(strip) : null, below ? el("small", {}, below) : null);
  }

  function notes(state) {
    const { track } = state;
    return el("div", { class: "notes" },
      el("p", {}, `Rank: the best and the worst place that a model may have by ${track.title}, ${track.main}, from tests of every pair of models on the samples that both have, corrected for their number (Holm, 95 %). Models whose ranks overlap may be equally good. Baselines have no rank, nor have models that were not asked everything.`),
      el("p", {}, "Under a value stands its 95 % interval, from leaving out each base scene in turn."),
      state.wanted.includes("date") ? el("p", {}, `Asked on: ${Table.ASKED[0].toLowerCase()}${Table.ASKED.slice(1)}.`) : null,
      track.notes.map((note) => el("p", {}, note)),
      el("p", {}, "“Scored again” are runs that came as a bundle, whose replies were scored again when this page was made and came out the same. A model's page lists what was not verified."),
      track.physics ? el("p", {}, `${track.title}: physics is not carried out again, what fell is taken from the records.`) : null);
  }

  function chart(state) {
    const { data, track } = state;
    const column = state.main;
    const axes = column ? Chart.axes(data, track) : [];
    if (!axes.length) {
      return el("section", { class: "costs" }, el("h2", {}, "Cost against score"),
        el("p", { class: "muted" }, "Nothing to draw: fewer than two models have a known price, token count or time."));
    }
    const axis = axes.some(([name]) => name === state.axis) ? state.axis : axes[0][0];
    const { drawing, without } = Chart.draw(data, track, column, axis);
    const choice = el("label", { class: "choice" }, el("span", {}, "Across"),
      el("select", { id: "axis", onchange: (event) => go(state, { axis: event.target.value }) },
        axes.map(([name, title]) => el("option", { value: name, selected: name === axis }, title))));
    return el("section", { class: "costs" }, el("h2", {}, "Cost against score"), el("div", { class: "tools" }, choice),
      el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Cost against score" }, drawing),
      el("p", { class: "notes" }, [`${track.title}. Bars are 95 % intervals. Squares are baselines.`,
        data.rows.some((row) => Table.isCut(row, track.name)) ? " Hollow points were not asked everything." : "",
        without.length ? ` Not drawn, as nothing is known: ${without.map((row) => row.name).join(", ")}.` : ""].join("")));
  }

  // ---- a model

  async function model(words) {
    const data = await Store.openBoard();
    const place = data.rows.findIndex((row) => row.name === words.get("m"));
    if (place < 0) return unknown("model", words.get("m"));
    const row = data.rows[place];
    const runs = [...new Set(Object.values(row.runs))].map((n) => data.runs[n]);
    const facts = [
      ["Kind", { litellm: "asked over the network", replay: "a recording", baseline: "a baseline: a rule" }[row.kind] || row.kind],
      ["Parameters", row.size_b === null ? null : `${row.size_b} billion`],
      ...runs.flatMap((run) => [["Run", `${run.suite || "run"} ${run.id}, begun ${run.date || "on an unknown day"}`],
        ["Scored again", run.verified ? "yes, from a bundle" : "no: taken from a run folder"],
        ["Not verified", run.unverified.join(" ") || null],
        ["Seeds", String(run.seeds)], ["Asked how", run.asked.join(", ") || null]]),
    ];
    await Store.openSamples();
    return [
      crumbs([["board", {}, "Ranking"]]),
      el("h1", {}, row.name),
      el("dl", { class: "about" }, facts.filter(([, value]) => value).map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value)))),
      ...data.tracks.filter((track) => row.facts[track.name]).map((track) => ofTrack(data, row, place, track)),
    ];
  }

  function ofTrack(data, row, place, track) {
    const columns = data.columns.filter((column) => column.track === track.name);
    const settings = [...new Set(columns.map((column) => column.setting))];
    const headings = [...new Set(columns.map((column) => column.heading))];
    const fact = row.facts[track.name];
    const rank = Table.rank(row, track.name);
    const took = [
      ["Rank", rank === DASH ? null : `${rank} by ${track.main}`],
      ["Samples", fact.done < fact.expected ? `${fact.done.toLocaleString("en")} of ${fact.expected.toLocaleString("en")} done` : fact.done.toLocaleString("en")],
      ["Solved", fact.solved === null ? null : fact.solved.toLocaleString("en")],
      ["Not read or failed", fact.failed.toLocaleString("en")],
      ["Tokens in", fact.prompt_tokens && text(fact.prompt_tokens, 0)], ["Tokens out", fact.completion_tokens && text(fact.completion_tokens, 0)],
      ["100 replies", fact.usd_per_100 && `$${Table.dollars(fact.usd_per_100)}`],
      [`A solved ${track.item}`, fact.usd_per_solved && `$${Table.dollars(fact.usd_per_solved)}`],
    ];
    const id = `track-${track.name}`;
    return el("section", { "aria-labelledby": id }, el("h2", { id }, track.title),
      el("dl", { class: "about small" }, took.filter(([, value]) => value).map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", { class: "number" }, value)))),
      el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `${track.title}, values` }, el("table", { class: "values" },
        el("thead", {}, el("tr", {}, settings[0] ? el("th", { scope: "col", class: "text" }, "Setting") : el("td"),
          headings.map((heading) => el("th", { scope: "col" }, heading)))),
        el("tbody", {}, settings.map((setting) => el("tr", {}, el("th", { scope: "row", class: "text" }, setting || "All"),
          headings.map((heading) => {
            const column = columns.find((one) => one.setting === setting && one.heading === heading);
            const found = column && row.values[column.id];
            return el("td", { class: heading === track.main ? "main" : null }, found ? text(found[0]) : DASH,
              found && found[1] !== null ? el("small", {}, `${text(found[1])} to ${text(found[2])}`) : null);
          })))))),
      el("h3", {}, `Every ${track.item}`),
      el("p", { class: "notes" }, `The number is what it scored (${track.main}), the mean where it was asked several times. Choose one to see a replay.`),
      tiles(items(Store.index.rowsOfEntry[place], track)));
  }

  /** Samples by item: [{sample, scores, outcomes}], the worst first. */
  function items(rows, track) {
    const found = new Map();
    for (const row of rows) {
      const sample = Store.sample(row);
      if (sample.track !== track) continue;
      if (!found.has(sample.item)) found.set(sample.item, { sample, scores: [], outcomes: [] });
      const one = found.get(sample.item);
      if (sample.score !== null) one.scores.push(sample.score);
      else one.outcomes.push(sample.outcome);
    }
    const mean = ({ scores }) => (scores.length ? scores.reduce((sum, score) => sum + score, 0) / scores.length : null);
    return [...found.values()].map((one) => ({ ...one, score: mean(one), track }))
      .sort((a, b) => worse(a.score, b.score, track) || a.sample.key.localeCompare(b.sample.key));
  }

  /** For sorting by scores, the worst first: none, then what the track's measure calls worse. */
  function worse(a, b, track) {
    if (a === null || b === null) return (a !== null) - (b !== null);
    return track.better === "lower" ? b - a : a - b;
  }

  function tiles(list) {
    return el("ul", { class: "tiles" }, list.map(({ sample, score, outcomes, track }) => el("li", {},
      link("replay", Site.wordsOf(sample), el("span", { class: "tile-name" }, sample.key), shade(score, track, outcomes[0])))));
  }

  /** A score with a shade behind it; the number says it all without the shade. */
  function shade(score, track, outcome) {
    const share = score === null ? 0 : track.better === "lower" || track.best === null ? 0 : Math.max(0, Math.min(1, score / track.best));
    const made = el("span", { class: `shade number shade-${Math.round(share * 5)}` }, score === null ? Words.named(outcome || "missing") : text(score, score === 100 ? 0 : 1));
    return made;
  }

  // ---- scenes

  async function scenes(words) {
    const data = await Store.openBoard();
    const index = await Store.openSamples();
    const track = data.tracks.find(({ name }) => name === words.get("t")) || data.tracks[0];
    const sums = new Map();
    const isModel = data.rows.map((row) => row.kind !== "baseline");
    // Baselines know the goal or do not look: they say nothing of how hard a scene is to models.
    const counts = isModel.includes(true) ? (row) => isModel[index.rows.entry[row]] : () => true;
    index.rows.item.forEach((item, row) => {
      if (!counts(row) || index.tracks[index.items.track[item]] !== track.name || index.rows.score[row] === null) return;
      const scene = index.items.scene[item];
      const sum = sums.get(scene) || { n: 0, sum: 0, levels: index.items.levels[item] };
      sum.n += 1;
      sum.sum += index.rows.score[row] / 10;
      sums.set(scene, sum);
    });
    const wanted = (words.get("q") || "").toLowerCase();
    const list = [...sums].map(([scene, { n, sum, levels }]) => ({ name: index.scenes[scene], score: sum / n, levels }))
      .filter(({ name }) => name.toLowerCase().includes(wanted))
      .sort((a, b) => worse(a.score, b.score, track) || a.name.localeCompare(b.name));
    const choice = data.tracks.length > 1 ? el("label", { class: "choice" }, el("span", {}, "Track"),
      el("select", { id: "track", onchange: (event) => Site.go("scenes", { t: event.target.value, q: words.get("q") }) },
        data.tracks.map((one) => el("option", { value: one.name, selected: one === track }, one.title)))) : null;
    const search = el("label", { class: "choice" }, el("span", {}, "Find"), el("input", { type: "search", id: "find", value: words.get("q") || "",
      onchange: (event) => Site.go("scenes", { t: words.get("t"), q: event.target.value }) }));
    return [
      el("h1", {}, "Scenes"),
      el("p", { class: "lead" }, `The mean score of all ${isModel.includes(true) ? "models" : "baselines"} in ${track.title.toLowerCase()}, the hardest first.`),
      el("div", { class: "tools" }, choice, search),
      el("p", { class: "muted", role: "status" }, plural(list.length, "scene")),
      el("ul", { class: "tiles" }, list.map(({ name, score, levels }) => el("li", {},
        link("scene", { s: name }, el("span", { class: "tile-name" }, name, el("small", {}, `level ${levels.join(", ")}`)), shade(score, track))))),
    ];
  }

  async function scene(words) {
    const data = await Store.openBoard();
    const index = await Store.openSamples();
    const place = index.scenes.indexOf(words.get("s"));
    if (place < 0) return unknown("scene", words.get("s"));
    const drawn = index.starts.scenes.length ? await Store.entry("scenes", place) : null;
    const mine = index.items.scene.flatMap((one, item) => (one === place ? [item] : []));
    const first = index.items.levels[mine[0]];
    const facts = [["Blocks", drawn ? String(drawn.blocks.length) : null], ["Level", first.join(" and ")], ["Candidates", drawn ? String(drawn.candidates.length) : null]];
    return [
      crumbs([["board", {}, "Ranking"], ["scenes", {}, "Scenes"]]),
      el("h1", {}, words.get("s")),
      el("div", { class: "scene-head" },
        drawn ? el("figure", {}, Stage.picture(`The goal, ${plural(drawn.blocks.length, "block")}`, drawn.blocks, { grid: true })) : el("p", { class: "notice" }, index.lacking || "The scene is not at hand."),
        el("dl", { class: "about" }, facts.filter(([, value]) => value).map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", { class: "number" }, value))))),
      ...data.tracks.map((track) => sceneTrack(data, track, words.get("s"), mine.filter((item) => index.tracks[index.items.track[item]] === track.name))).filter(Boolean),
    ];
  }

  function sceneTrack(data, track, scene, mine) {
    if (!mine.length) return null;
    const id = `track-${track.name}`;
    return el("section", { "aria-labelledby": id }, el("h2", { id }, track.title),
      mine.map((item) => el("div", {}, mine.length > 1 || Store.index.items.key[item] !== scene ? el("h3", {}, Store.index.items.key[item]) : null,
        itemTable(data, track, item))));
  }

  function itemTable(data, track, item) {
    const samples = Store.index.rowsOfItem[item].map(Store.sample);
    const byEntry = new Map();
    for (const sample of samples) byEntry.set(sample.entry, [...(byEntry.get(sample.entry) || []), sample]);
    const best = (list) => list.map((sample) => sample.score).sort((a, b) => worse(b, a, track))[0];
    const rows = [...byEntry].sort((a, b) => worse(best(b[1]), best(a[1]), track) || a[0].name.localeCompare(b[0].name));
    return el("ul", { class: "answers" }, rows.map(([entry, list]) => el("li", {},
      el("span", { class: "answer-name" }, link("model", { m: entry.name }, entry.name)),
      el("span", { class: "answer-scores" }, list.map((sample) => link("replay", Site.wordsOf(sample),
        el("span", { class: "unseen" }, `${entry.name}${list.length > 1 ? `, seed ${sample.seed}` : ""}${sample.way ? `, ${sample.way}` : ""}: `),
        shade(sample.score, track, sample.outcome)))))));
  }

  // ---- common

  function crumbs(list) {
    return el("nav", { class: "crumbs", "aria-label": "Above" }, list.map(([view, words, name], i) => [i ? el("span", { "aria-hidden": "true" }, " › ") : null, link(view, words, name)]));
  }

  function unknown(noun, name) {
    return [crumbs([["board", {}, "Ranking"]]), el("h1", {}, `There is no such ${noun}`),
      el("p", { class: "lead" }, name ? `This site has no ${noun} called “${name}”.` : `The address names no ${noun}.`)];
  }

  return { board, model, scenes, scene, unknown, crumbs, link, shade };
})();
