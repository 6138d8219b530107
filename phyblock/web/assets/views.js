/* A model, all scenes, one scene: on a report and on a leaderboard. */
"use strict";

const Views = (() => {
  const { number, DASH } = Words;
  const link = (view, words, ...children) => el("a", { href: App.address(view, words) }, ...children);
  const isBuilt = (sample) => sample.part === null && sample.score !== null && Data.index.starts.scenes.length > 0;

  // ---- a model

  async function model(words) {
    const { board } = Data, place = board.rows.findIndex((row) => row.name === words.get("m"));
    if (place < 0) return unknown("model", words.get("m"));
    await Data.open();
    const row = board.rows[place];
    const runs = [...new Set(Object.values(row.runs))].map((n) => board.runs[n]);
    const kinds = { litellm: "asked over the network", replay: "a recording", baseline: "a baseline: a rule" };
    return [
      el("h1", {}, row.name),
      listOf([
        ["Kind", kinds[row.kind] || row.kind], ["Parameters", row.size_b && `${row.size_b} billion`],
        ...runs.flatMap((run) => [["Run", `${run.suite || "run"} ${run.id}, begun ${run.date || "on an unknown day"}`],
          ["Independently re-scored", !Data.isSite ? null : run.verified ? "yes, from a bundle" : "no: taken from a run folder"],
          ["Not verified", run.unverified.join(" ")], ["Seeds", run.seeds], ["Asked how", run.asked.join(", ")]]),
      ]),
      ...await Promise.all(board.tracks.filter((track) => row.facts[track.name]).map((track) => ofTrack(row, place, track))),
    ];
  }

  async function ofTrack(row, place, track) {
    const columns = Data.board.columns.filter((column) => column.track === track.name);
    const headings = [...new Set(columns.map(({ heading }) => heading))];
    const settings = [...new Set(columns.map(({ setting }) => setting))];
    const fact = row.facts[track.name], rank = Table.rank(row, track);
    const cell = (heading) => (setting) => {
      const [value, lo, hi] = row.values[columns.find((one) => one.setting === setting && one.heading === heading)?.id] || [null, null];
      return { text: number(value), below: lo === null ? "" : `${number(lo)} to ${number(hi)}` };
    };
    return el("section", { "aria-label": track.title }, el("h2", {}, track.title),
      listOf([
        ["Rank", rank === DASH ? null : `${rank} by ${track.main}`],
        ["Samples", Table.lacking(row, track) || number(fact.recorded, 0)], ["Solved", fact.solved],
        ["Not read or failed", number(fact.recorded - fact.ok, 0)], ["Tokens in, mean", fact.prompt_tokens && number(fact.prompt_tokens, 0)],
        ["Tokens out, mean", fact.completion_tokens && number(fact.completion_tokens, 0)], ["100 replies", fact.cost_per_100_usd && `$${Words.dollars(fact.cost_per_100_usd)}`],
      ]),
      Table.made({ caption: `${track.title}, values`, head: "Setting", name: (setting) => setting || "All", rows: settings,
        columns: headings.map((heading) => ({ heading, isMain: heading === track.main, cell: cell(heading) })) }),
      Charts.losses(track, [row]), await telling(row, place, track), neighbours(row, track),
      el("p", {}, link("samples", { track: track.name, model: row.name, order: "worst" }, "All its samples, the worst first")));
  }

  /** Six samples that it failed where the others did better, each at its first wrong step. */
  async function telling(row, place, track) {
    const sign = track.better === "lower" ? -1 : 1;
    const gaps = Data.index.rowsOfEntry[place].map(Data.sample).filter((one) => one.track === track && isBuilt(one)).map((sample) => {
      const others = Data.index.rowsOfItem[sample.item].map(Data.sample)
        .filter((one) => one.entry !== row && Data.isModel(one.entry) && one.score !== null).map(({ score }) => score);
      return { sample, gap: others.length ? sign * (mean(others) - sample.score) : 0 };
    }).filter(({ sample, gap }) => gap > 0 && sample.score > 0)
      .sort((a, b) => b.gap - a.gap || a.sample.key.localeCompare(b.sample.key)).slice(0, 12);
    const cards = await Promise.all(gaps.map(({ sample, gap }) => Results.failure(sample.row, `${sample.key}, ${number(gap)} behind the mean`)));
    const items = cards.filter(Boolean).slice(0, 6).map(({ item }) => item);
    return items.length ? [el("h3", {}, "Where it falls furthest behind the others"), el("ul", { class: "cards" }, items)] : null;
  }

  /** On how many items it beats the models beside it in the ranking, and loses to them. */
  function neighbours(row, track) {
    const all = Charts.ranked(track), at = all.indexOf(row), sign = track.better === "lower" ? -1 : 1;
    const scores = (one) => new Map(Data.index.rowsOfEntry[Data.board.rows.indexOf(one)].map(Data.sample)
      .filter((sample) => sample.track === track && sample.score !== null).map((sample) => [`${sample.item} ${sample.seed} ${sample.way}`, sample.score]));
    if (at < 0) return null;
    const mine = scores(row);
    const lines = [all[at - 1], all[at + 1]].filter(Boolean).map((other) => {
      const gaps = [...scores(other)].filter(([key]) => mine.has(key)).map(([key, score]) => Math.sign(sign * (mine.get(key) - score)));
      const count = (way) => gaps.filter((gap) => gap === way).length;
      return el("li", {}, `${Words.count(count(1), track.item)} better than `, link("model", { m: other.name }, other.name), `, ${count(-1)} worse, ${count(0)} equal`);
    });
    return lines.length ? [el("h3", {}, "Beside its neighbors"), el("ul", {}, lines)] : null;
  }

  /** A sample as a small picture of what it built, with its score. */
  function tile(sample) {
    const { name } = sample;
    return el("li", {}, link("samples", { track: sample.track.name, s: sample.id },
      isBuilt(sample) ? Stage.picture(`Built by ${sample.name} in ${sample.key}`, () => builtBy(sample)) : null,
      el("strong", {}, name), sample.score === null ? el("span", { class: "muted" }, ` ${Words.named(sample.outcome)}`) : null,
      sample.score === null ? null : Charts.score(sample.score, sample.track)));
  }

  /** The end of a sample's build; null where nothing is known of it. */
  async function builtBy(sample) {
    const record = await Data.entry("records", sample.row);
    const scene = Steps.asShown(await Data.scene(sample.sceneNumber), record);
    if (!scene) return null;
    const { states, framed } = Steps.of(scene, record, Sample.settingsOf(record)[0]);
    return [states.at(-1).at(-1).blocks, { framed }];
  }

  // ---- scenes

  /** The mean score of each scene in a track, over models, or over baselines where there are none. */
  function sums(track) {
    const { index, board } = Data, found = new Map();
    // Baselines know the goal or do not look: they say nothing of how hard a scene is to models.
    const counts = board.rows.some(Data.isModel) ? board.rows.map(Data.isModel) : board.rows.map(() => true);
    index.rows.item.forEach((item, row) => {
      const { scene, levels } = index.items, score = index.rows.score[row];
      if (score === null || !counts[index.rows.entry[row]] || index.tracks[index.items.track[item]] !== track.name) return;
      const sum = found.get(scene[item]) || { scene: scene[item], name: index.scenes[scene[item]], levels: levels[item], scores: [] };
      sum.scores.push(score);
      found.set(scene[item], sum);
    });
    return [...found.values()].map((one) => ({ ...one, score: mean(one.scores) }))
      .sort((a, b) => Data.worse(a.score, b.score, track) || a.name.localeCompare(b.name));
  }

  async function scenes(words) {
    await Data.open();
    const track = Data.trackOf(words.get("track")), wanted = (words.get("q") || "").toLowerCase(), level = words.get("level") || "";
    const all = sums(track), levels = [...new Set(all.flatMap((one) => one.levels))].sort();
    const list = all.filter((one) => one.name.toLowerCase().includes(wanted) && (!level || one.levels.includes(Number(level))));
    const go = (changes) => App.go("scenes", { ...Object.fromEntries(words), ...changes }, false);
    return [
      el("h1", {}, "Scenes"),
      el("p", { class: "lead" }, `The mean score of all ${Data.board.rows.some(Data.isModel) ? "models" : "baselines"} in ${track.title.toLowerCase()}, the hardest first.`),
      el("div", { class: "tools" },
        Data.board.tracks.length > 1 ? choice("track", "Track", Data.board.tracks.map(({ name, title }) => [name, title]), track.name, (value) => go({ track: value })) : null,
        levels.length > 1 ? choice("level", "Level", [["", "All"], ...levels.map((n) => [String(n), `Level ${n}`])], level, (value) => go({ level: value })) : null,
        el("label", { class: "choice" }, el("span", {}, "Find"), el("input", { type: "search", id: "find", value: words.get("q") || "", onchange: (event) => go({ q: event.target.value }) })),
        el("p", { class: "muted", role: "status" }, Words.count(list.length, "scene"))),
      el("ul", { class: "thumbs" }, list.map((one) => el("li", {}, link("scene", { s: one.name },
        Data.index.starts.scenes.length ? Stage.picture(`The goal of ${one.name}`, async () => {
          const scene = await Data.scene(one.scene);
          return scene && [scene.blocks];
        }) : null,
        el("span", {}, one.name, el("small", {}, ` level ${one.levels.join(", ")}`)), Charts.score(one.score, track))))),
    ];
  }

  async function scene(words) {
    const index = await Data.open(), place = index.scenes.indexOf(words.get("s"));
    if (place < 0) return unknown("scene", words.get("s"));
    const drawn = await Data.scene(place), items = index.items.scene.flatMap((one, item) => (one === place ? [item] : []));
    return [
      el("h1", {}, `Scene ${words.get("s")}`),
      listOf([["Blocks", drawn?.blocks.length], ["Level", index.items.levels[items[0]].join(" and ")]]),
      drawn ? el("div", { class: "scene-head" }, el("figure", {}, Stage.picture(`The goal, ${Words.count(drawn.blocks.length, "block")}`, [drawn.blocks])), Sample.candidates(drawn))
        : el("p", { class: "notice" }, index.lacking || "The scene is not at hand."),
      ...Data.board.tracks.map((track) => {
        const mine = items.filter((item) => index.tracks[index.items.track[item]] === track.name);
        return mine.length ? el("section", { "aria-label": track.title }, el("h2", {}, track.title), mine.map((item) => wall(track, item, words.get("s")))) : null;
      }),
    ];
  }

  /** What every model built of an item, the best first. */
  function wall(track, item, scene) {
    const samples = Data.index.rowsOfItem[item].map(Data.sample)
      .sort((a, b) => Data.worse(b.score, a.score, track) || a.name.localeCompare(b.name));
    const key = Data.index.items.key[item];
    return [key === scene ? null : el("h3", {}, key), el("ul", { class: "wall" }, samples.map(tile))];
  }

  const unknown = (noun, name) => [el("h1", {}, `There is no such ${noun}`),
    el("p", { class: "lead" }, name ? `There is no ${noun} called “${name}” here.` : `The address names no ${noun}.`)];

  return { model, scenes, scene, unknown };
})();
