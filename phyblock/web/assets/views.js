/* The pages of a site below the first: a model, all scenes, a scene. */
"use strict";

const Views = (() => {
  const { text, DASH } = Table;
  const link = (view, words, ...children) => el("a", { href: Site.address(view, words) }, ...children);
  const plural = (n, noun) => Words.count(n, noun);

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
        ["Independently re-scored", run.verified ? "yes, from a bundle" : "no: taken from a run folder"],
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
      profile(data, row, track), telling(row, place, track), neighbours(data, row, track),
      el("details", {}, el("summary", {}, `Every ${track.item}`),
        el("p", { class: "notes" }, `The number is what it scored (${track.main}), the mean where it was asked several times. Choose one to see a replay.`),
        tiles(items(Store.index.rowsOfEntry[place], track))));
  }

  /** What its wrong steps are of, as bars. */
  function profile(data, row, track) {
    const errors = Object.entries(row.facts[track.name].errors || {}).sort((a, b) => b[1] - a[1]);
    if (!errors.length) return null;
    return [el("h3", {}, "Its wrong steps"), el("div", { class: "profile" }, errors.flatMap(([name, share]) => {
      const fill = el("i");
      fill.style.width = `${share}%`;
      return [el("span", {}, Words.named(name)), el("span", { class: "score-bar", "aria-hidden": "true" }, fill), el("span", { class: "number" }, `${text(share)} %`)];
    }))];
  }

  /** Six samples that it failed where most others did better. */
  function telling(row, place, track) {
    const mean = (list) => list.reduce((sum, one) => sum + one, 0) / list.length;
    const sign = track.better === "lower" ? -1 : 1;
    const mine = Store.index.rowsOfEntry[place].map(Store.sample).filter((one) => one.track === track && one.score !== null && isBuilt(one));
    const gaps = mine.map((sample) => {
      const others = Store.index.rowsOfItem[sample.item].map(Store.sample)
        .filter((one) => one.entry !== row && one.entry.kind !== "baseline" && one.score !== null).map((one) => one.score);
      return { sample, gap: others.length ? sign * (mean(others) - sample.score) : -Infinity };
    }).filter(({ sample, gap }) => gap > 0 && sample.score > 0).sort((a, b) => b.gap - a.gap || a.sample.key.localeCompare(b.sample.key)).slice(0, 6);
    if (!gaps.length) return null;
    return [el("h3", {}, "Where it falls furthest behind the others"), el("ul", { class: "wall" }, gaps.map(({ sample, gap }) => el("li", {},
      link("replay", Site.wordsOf(sample), brought(`Built in ${sample.key}`, () => builtBy(sample)), el("strong", {}, sample.key),
        el("span", { class: "muted" }, ` ${text(gap)} behind the mean`), bar(sample.score, track)))))];
  }

  /** On how many items it beats the models beside it in the ranking, and loses to them. */
  function neighbours(data, row, track) {
    const main = data.columns.find((column) => column.track === track.name && column.heading === track.main);
    if (row.kind === "baseline" || !main) return null;
    const ranked = Table.sorted(data.rows.filter((one) => one.kind !== "baseline" && one.values[main.id]), { value: (one) => one.values[main.id][0] }, track.better !== "lower");
    const at = ranked.indexOf(row);
    const scores = (one) => new Map(Store.index.rowsOfEntry[data.rows.indexOf(one)].map(Store.sample)
      .filter((sample) => sample.track === track && sample.score !== null).map((sample) => [`${sample.item} ${sample.seed} ${sample.way}`, sample.score]));
    const mine = scores(row);
    const lines = [ranked[at - 1], ranked[at + 1]].filter(Boolean).map((other) => {
      const pairs = [...scores(other)].filter(([key]) => mine.has(key)).map(([key, score]) => (track.better === "lower" ? -1 : 1) * (mine.get(key) - score));
      return el("li", {}, `${plural(pairs.filter((gap) => gap > 0).length, track.item)} better than `, link("model", { m: other.name }, other.name),
        `, ${pairs.filter((gap) => gap < 0).length} worse, ${pairs.filter((gap) => gap === 0).length} alike`);
    });
    return lines.length ? [el("h3", {}, "Beside its neighbors"), el("ul", { class: "notes" }, lines)] : null;
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
    const wanted = (words.get("q") || "").toLowerCase(), level = words.get("l") || "";
    const all = [...sums].map(([scene, { n, sum, levels }]) => ({ scene, name: index.scenes[scene], score: sum / n, levels }));
    const levels = [...new Set(all.flatMap((one) => one.levels))].sort((one, other) => one - other);
    const list = all.filter((one) => one.name.toLowerCase().includes(wanted) && (!level || one.levels.map(String).includes(level)))
      .sort((one, other) => worse(one.score, other.score, track) || one.name.localeCompare(other.name));
    const go = (changes) => Site.go("scenes", { t: words.get("t"), q: words.get("q"), l: level, ...changes });
    const choice = (id, name, options, act) => el("label", { class: "choice" }, el("span", {}, name),
      el("select", { id, onchange: (event) => act(event.target.value) }, options.map(([value, shown, isOn]) => el("option", { value, selected: isOn }, shown))));
    const search = el("label", { class: "choice" }, el("span", {}, "Find"), el("input", { type: "search", id: "find", value: words.get("q") || "",
      onchange: (event) => go({ q: event.target.value }) }));
    return [
      el("h1", {}, "Scenes"),
      el("p", { class: "lead" }, `The mean score of all ${isModel.includes(true) ? "models" : "baselines"} in ${track.title.toLowerCase()}, the hardest first.`),
      el("div", { class: "tools" },
        data.tracks.length > 1 ? choice("track", "Track", data.tracks.map((one) => [one.name, one.title, one === track]), (value) => go({ t: value })) : null,
        levels.length > 1 ? choice("level", "Level", [["", "All", !level], ...levels.map((one) => [String(one), `Level ${one}`, String(one) === level])], (value) => go({ l: value })) : null,
        search),
      el("p", { class: "muted", role: "status" }, plural(list.length, "scene")),
      el("ul", { class: "thumbs" }, list.map((one) => thumb(one, track))),
    ];
  }

  const inSight = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) {
      if (!isIntersecting) continue;
      inSight.unobserve(target);
      target.bring();
    }
  }, { rootMargin: "300px" });

  /** A picture that is brought and drawn when it comes into sight: `blocks` gives it, or null. */
  function brought(label, blocks) {
    const canvas = el("canvas", { class: "picture goal", role: "img", "aria-label": label });
    canvas.drawing = [[], { grid: true }];
    canvas.bring = async () => {
      const found = await blocks();
      if (!found || !canvas.isConnected) return;
      canvas.drawing = [found.blocks, { grid: true, ...found.options }];
      Stage.draw(canvas.parentElement);
    };
    inSight.observe(canvas);
    return canvas;
  }

  function thumb({ scene, name, score, levels }, track) {
    const isDrawn = Store.index.starts.scenes.length;
    return el("li", {}, link("scene", { s: name },
      isDrawn ? brought(`The goal of ${name}`, () => Store.entry("scenes", scene)) : null,
      el("span", { class: "tile-name" }, name, el("small", {}, `level ${levels.join(", ")}`)), bar(score, track)));
  }

  /** A score as a bar with its number. */
  function bar(score, track) {
    const share = score === null || track.best === null ? 0 : Math.max(0, Math.min(1, track.better === "lower" ? 1 - score / (track.best || 100) : score / track.best));
    const fill = el("i");
    fill.style.width = `${100 * share}%`;
    return [el("span", { class: "number score" }, score === null ? "–" : text(score)), el("span", { class: "score-bar", "aria-hidden": "true" }, fill)];
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
    return el("ul", { class: "wall" }, rows.flatMap(([entry, list]) => list.map((sample) => el("li", {}, link("replay", Site.wordsOf(sample),
      isBuilt(sample) ? brought(`Built by ${entry.name}`, () => builtBy(sample)) : null,
      el("strong", {}, entry.name), el("span", { class: "muted" }, list.length > 1 ? ` seed ${sample.seed}` : "", sample.way ? ` ${sample.way}` : ""),
      sample.score === null ? el("span", { class: "muted" }, ` ${Words.named(sample.outcome)}`) : bar(sample.score, track))))));
  }

  const isBuilt = (sample) => Store.index.starts.scenes.length > 0 && sample.part === null && sample.score !== null;

  /** What stands at the end of a sample, framed as its goal; null where nothing is known of it. */
  async function builtBy(sample) {
    const scene = await Store.entry("scenes", sample.sceneNumber), record = await Store.entry("replays", sample.row);
    const score = (record.scores || []).find(({ placed }) => placed);
    if (!scene || !(score || record.turns || record.pose)) return null;
    const shown = Steps.asShown(scene, record);
    const { states, framed } = Runs.of(shown, record, score?.setting || "A", score);
    const end = states.at(-1)?.at(-1);
    return end ? { blocks: end.blocks, options: { framed } } : null;
  }

  // ---- common

  function crumbs(list) {
    return el("nav", { class: "crumbs", "aria-label": "Above" }, list.map(([view, words, name], i) => [i ? el("span", { "aria-hidden": "true" }, " › ") : null, link(view, words, name)]));
  }

  function unknown(noun, name) {
    return [crumbs([["board", {}, "Ranking"]]), el("h1", {}, `There is no such ${noun}`),
      el("p", { class: "lead" }, name ? `This site has no ${noun} called “${name}”.` : `The address names no ${noun}.`)];
  }

  return { model, scenes, scene, unknown, crumbs, link, shade };
})();
