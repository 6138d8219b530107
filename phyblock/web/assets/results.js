/* The first page: the finding, the ranking as bars, what it looks like; then all tables of a report,
   or how to take part in a leaderboard. */
"use strict";

const Results = (() => {
  const LOOP_MS = 900;
  const REST_MS = 2600;
  const NOTE = "Intervals: jackknife over base scenes. Ranks are ranges: paired tests of every pair of models, corrected for their number (Holm). Baselines, and models that were not asked about every sample, have no rank.";
  const { number } = Words;
  let clock = null;

  async function view() {
    const { board, isSite } = Data;
    const failures = el("ul", { class: "cards" });
    const fails = el("section", { hidden: true }, el("h2", {}, "How they fail"), failures);
    const hero = isSite ? el("div", { class: "hero-build", "aria-hidden": "true" }) : null;
    clearTimeout(clock);
    show(failures, hero).catch(() => hero?.remove());
    return [
      isSite ? el("section", { class: "hero" }, el("div", { class: "hero-text" }, intro(board),
        findings(board.tracks[0]).slice(0, 2),
        el("p", { class: "muted" }, "Try it yourself: ", el("code", {}, "phyblock play quick"), " gives you the models' own tasks in a browser.")), hero)
        : el("section", {}, intro(board), cautions(board.cautions), listOf(board.facts)),
      ...board.tracks.map((track) => ofTrack(track, isSite && track === board.tracks[0])),
      fails,
      ...isSite ? method(board) : [el("section", { class: "tables" }, el("h2", {}, "All tables"), board.tables.map((table) =>
        el("details", {}, el("summary", {}, table.caption), Table.written(table))))],
    ];
  }

  const intro = (board) => [el("h1", {}, board.title), board.about ? el("p", { class: "lead" }, board.about) : null];

  function cautions([first, ...rest]) {
    if (!first) return null;
    return el("div", { class: "caution", role: "note", "aria-label": "Limits of this run" }, el("p", {}, first),
      rest.length ? el("details", {}, el("summary", {}, `${rest.length} more`), el("ul", {}, rest.map((one) => el("li", {}, one)))) : null);
  }

  function ofTrack(track, isSaid) {
    const id = `ranking-${track.name}`;
    if (!Data.mainOf(track)) return el("p", { class: "muted" }, `Nothing is scored in ${track.title}.`);
    return el("section", { id, "aria-label": track.title }, el("h2", {}, track.title),
      isSaid ? null : findings(track),
      Charts.bars(track),
      el("details", { class: "more" }, el("summary", {}, "All numbers: intervals, settings, tokens and cost"), Table.numbers(track)),
      el("ul", { class: "notes" }, [...track.notes, track === Data.board.tracks[0] && NOTE,
        track.physics && "What fell is taken from the records; physics is not run again."].filter(Boolean).map((note) => el("li", {}, note))),
      Charts.slope(track), Charts.losses(track));
  }

  /** How the models stand to a rule that never sees the goal, which one is best, which error is most frequent. */
  function findings(track) {
    const main = Data.mainOf(track), models = Charts.ranked(track).filter((row) => Data.isModel(row) && row.values[main.id]);
    const [best] = models, [value, lo, hi] = best?.values[main.id] || [], unit = track.unit ? ` ${track.unit}` : "";
    const wrong = track.errors.map((name) => [name, models.reduce((sum, row) => sum + (row.facts[track.name].errors[name] || 0) / models.length, 0)]);
    const [error] = wrong.filter(([, share]) => share).sort((a, b) => b[1] - a[1]);
    const others = best?.ranks[track.name]?.[1] > 1 ? `; others may be as good: rank ${Table.rank(best, track)}` : "";
    return [
      track.finding,
      best && `Best: ${best.name}, ${track.main} ${number(value)}${unit}${lo === null ? "" : ` (${number(lo)} to ${number(hi)})`}${others}.`,
      error && `Most frequent error: ${Words.named(error[0])}, ${number(error[1], 0)} % of wrong steps in the mean of models.`,
    ].filter(Boolean).map((sentence, i) => el("p", { class: i ? null : "finding" }, sentence));
  }

  // ---- what it looks like

  /** Once the page stands, show the failures that tell most, and the first of them as a loop. */
  async function show(failures, hero) {
    const index = await Data.open();
    const cards = (await Promise.all(index.telling.map((row) => failure(row)))).filter(Boolean);
    if (!cards.length || !failures.isConnected) return hero?.remove();
    failures.append(...cards.map(({ item }) => item));
    failures.parentElement.hidden = false;
    const most = Math.max(...cards.map(({ scene }) => scene.candidates.length));
    return hero && loop(hero, cards.find(({ scene }) => scene.candidates.length === most));
  }

  /** A sample at its first wrong step, beside its goal; null where nothing can be drawn. */
  async function failure(row, title = "") {
    const sample = Data.sample(row), record = await Data.entry("records", row);
    const scene = Steps.asShown(await Data.scene(sample.sceneNumber), record);
    if (!scene) return null;
    const run = Steps.of(scene, record, Sample.settingsOf(record)[0]);
    const at = run.steps.findIndex((step) => step.why), step = run.steps[at];
    if (!step) return null;
    const state = { ...run.states[at + 1][0], framed: run.framed, tried: step.tried, triedBadge: String(step.number) };
    const figure = (title, drawing) => el("figure", {}, Stage.picture(title, drawing), el("figcaption", {}, title));
    const item = el("li", {}, el("a", { href: App.address("samples", { s: sample.id }) },
      el("span", { class: "pair" }, figure("Goal", [scene.blocks]), figure(`Step ${at + 1}`, [state.blocks, { ...state, ghosts: [] }])),
      el("strong", {}, Words.named(step.why)), ` ${title || sample.name}: ${step.text}`));
    return { item, scene, run, name: sample.name };
  }

  /** The goal, its candidates and the build, which begins again after its end. */
  function loop(hero, { scene, run, name }) {
    const said = el("p", { class: "muted" }), end = run.steps.length;
    const built = Stage.picture("What was built", null);
    hero.replaceChildren(
      el("figure", {}, el("figcaption", {}, "Goal"), Stage.picture("The goal", [scene.blocks])),
      el("figure", {}, el("figcaption", {}, "Candidates"), el("ol", {}, scene.candidates.map((one, i) =>
        el("li", {}, el("span", { class: "number" }, String(i + 1)), Stage.candidate(one, i + 1))))),
      el("figure", {}, el("figcaption", {}, `Built by ${name}`), built, said));
    let at = Stage.isStill() ? end : 0;
    const tick = () => {
      if (!hero.isConnected) return;
      const [state] = run.states[at], step = run.steps[at - 1];
      built.drawing = [state.blocks, { ...state, ghosts: [], framed: run.framed, tried: step?.tried, triedBadge: String(step?.number) }];
      said.textContent = step ? `Step ${at}: candidate ${step.number}${step.why ? ` ✗ ${step.verdict}` : " ✓"}` : "";
      Stage.draw(built);
      if (Stage.isStill()) return;
      clock = setTimeout(tick, at === end ? REST_MS : LOOP_MS);
      at = at === end ? 0 : at + 1;
    };
    tick();
  }

  // ---- how it was done

  function method({ runs, rows }) {
    const samples = rows.flatMap((row) => Object.values(row.facts)).reduce((sum, fact) => sum + fact.recorded, 0);
    const dates = [...new Set(runs.map((run) => run.date).filter(Boolean).sort())];
    const verified = runs.filter((run) => run.verified).length, suite = runs[0].suite || "full", isOfficial = runs[0].data === "official";
    const where = (runs[0].limit ? ` --limit ${runs[0].limit}` : "") + (isOfficial ? " --set dataset.path=FOLDER   # a checkout of the official repository" : "");
    const said = [Words.count(rows.filter(Data.isModel).length, "model"), Words.count(samples, "sample"),
      isOfficial ? "official data" : runs[0].data && `data ${runs[0].data}, version ${runs[0].version}`, [...new Set([dates[0], dates.at(-1)])].filter(Boolean).join(" to ")];
    return [el("section", { class: "method" }, el("h2", {}, "Method"),
      el("p", {}, `${said.filter(Boolean).join("; ")}. ${verified} of ${Words.count(runs.length, "run")} independently re-scored.`),
      el("h3", {}, "Take part"),
      el("p", {}, "Run the suite, then send the bundle; it is scored again before it is listed:"),
      el("pre", { tabindex: 0 }, `phyblock run ${suite} --models my-model${where}\nphyblock bundle results/${suite}-… --out my-model.zip`),
      el("h3", {}, "Cite"),
      el("p", {}, "Ma, Wen, Lin, Xu, Liang, Lin et al.: PhyBlock: A Progressive Benchmark for Physical Understanding and Planning via 3D Block Assembly. NeurIPS 2025, Datasets and Benchmarks Track."))];
  }

  return { view, failure };
})();
